"""A file that is named and cannot be read: what is said, and which one is proposed."""

import pytest

from haptic_teleop_control.errors import ConfigurationError, ModelError, RecordingError
from haptic_teleop_control.parameter_files import load_parameter_file
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import load_model
from haptic_teleop_sim.model_choice import choose_model
from haptic_teleop_sysid.commands.hand_table import read_table
from haptic_teleop_sysid.logs.mapping import load_mapping
from haptic_teleop_sysid.logs.opened import open_recording


@pytest.fixture
def folder(tmp_path):
    for name in ("model.yaml", "sc.yaml", "good.csv", "results/model.yaml", "results/scenario.yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("haptic_teleop_model: 1\n")
    (tmp_path / "learn").mkdir()
    (tmp_path / "empty").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("read", "name", "proposed"),
    [
        (load_model, "model.yml", "model.yaml"),
        (load_model, "results", "results/model.yaml"),
        (load_parameter_file, "results", "results/scenario.yaml"),
        (load_parameter_file, "sc.yml", "sc.yaml"),
        (read_recording, "lern", "learn"),
        (open_recording, "god.csv", "good.csv"),
        (load_mapping, "goods.csv", "good.csv"),
        (lambda path: read_table(path, ("torque",)), "god.csv", "good.csv"),
    ],
)
def test_the_file_that_may_be_meant_is_proposed(folder, read, name, proposed):
    with pytest.raises((ConfigurationError, ModelError, RecordingError)) as refused:
        read(folder / name)
    assert f"did you mean {folder / proposed}?" in str(refused.value)
    assert "Errno" not in str(refused.value)


@pytest.mark.parametrize(("name", "said"), [("m.yaml", "no such file"), ("empty", "it is a folder")])
def test_nothing_is_proposed_where_nothing_is_alike(folder, name, said):
    with pytest.raises(ModelError, match=said) as refused:
        load_model(folder / name)
    assert "did you mean" not in str(refused.value) and "Errno" not in str(refused.value)


def test_a_model_file_in_place_of_a_scenario_file_is_told(folder):
    with pytest.raises(ConfigurationError, match="this is a model file, and a parameter file is needed"):
        load_parameter_file(folder / "model.yaml")


def test_a_model_that_is_nowhere_is_looked_for_once(folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises(ConfigurationError) as refused:
        choose_model("stage1", "zzz.txt", lambda joint: None, "", "sc.yaml")
    assert str(refused.value).count("zzz.txt") == 1
    with pytest.raises(ConfigurationError, match=r"looked for empty/zzz\.txt, zzz\.txt"):
        choose_model("stage1", "zzz.txt", lambda joint: None, "empty", "sc.yaml")


def test_a_table_without_its_column_is_told_with_those_that_it_has(tmp_path):
    (tmp_path / "t.csv").write_text("torque [N m],deflection\n0.1,0.2\n0.2,0.3\n")
    with pytest.raises(ConfigurationError, match=r"no column 'torque'.*has 'torque \[N m\]', 'deflection'"):
        read_table(tmp_path / "t.csv", ("torque", "deflection"))
