"""Diagnosis: locate a mismatch, name the physics that was left out, model it, show the fit improve.

`run.diagnose` calls the steps in this order:

1. `usable`: recordings as records; what cannot be used is refused in a sentence.
2. `believed`: what a search finds (`explain`: one-step prediction, and the inverse dynamics beside it), and
   what chance and the tests of a name leave of that (`question`); once more where the input between samples
   (`input_times`) or its time (`late_recordings`) is another one.
3. `examined`: the place, the law and the share of each name that is left.
4. `nearly_all`: names of the inverse dynamics, where no others are left and these explain nearly all.
5. `answered`: the verdict, and for physics without a name its place, a map or an encoder that reads wrong.
6. `report/`: fits, parameters, the page, the next experiment.

The steps use the folders below, from `inputs/` to `report/`; `policy` holds the numbers that decide.
"""
