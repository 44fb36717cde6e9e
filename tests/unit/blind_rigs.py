"""What tests of the blind benchmark share: the numbers of its robot, and a tool that sees nothing."""

KT, K, JM, BM, JA, BA = 8.925, 3.971, 0.0635, 2.6, 0.17, 0.02
FAKE = """
import argparse, json, pathlib, sys
p = argparse.ArgumentParser()
for name in ("--model", "--estimation", "--validation", "--output"):
    p.add_argument(name)
a = p.parse_args()
out = pathlib.Path(a.output)
out.mkdir()
kinds = [pathlib.Path(x).is_dir() for x in (a.estimation, a.validation)]
assert all(kinds) and pathlib.Path(a.model).is_file()
(out / "diagnosis.json").write_text(json.dumps({"verdict": "no_mismatch", "findings": []}))
"""
