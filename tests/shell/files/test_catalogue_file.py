"""The user's own table of models, in TOML and in CSV."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.catalogue import BUILT_IN, Catalogue, find_model
from rosbridge_sim.shell.files.catalogue_file import read_catalogue
from rosbridge_sim.world.state.world import Kind
from tests.mutations import examples

TOML = """
# ours
[[model]]
DataID = 30200005
name = "Sonata"
class = "vehicle"
length = 4.9
width = 1.86
height = 1.445
wheelbase = 2.84
rear_overhang = 1.1
max_steer = 35
mass = 1500

[[model]]
DataID = [40100019, 40100020]
name = "Fridge"
length = 0.7
width = 0.6
height = 1.8
"""

CSV = """DataID,name,class,length,width,height,wheelbase,rear overhang,max steer,mass
30200005,Sonata,vehicle,4.9,1.86,1.445,2.84,1.1,35,1500
# a remark
"40100019 40100020",Fridge,,0.7,0.6,1.8,,,,
"""


def read(text: str | bytes, tmp_path: Path, name: str) -> Catalogue:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_catalogue(path)


def refusal(text: str | bytes, tmp_path: Path, name: str) -> str:
    """The error's text, without the folder; one line, as every error of a file must be."""
    with pytest.raises(DocumentError) as caught:
        read(text, tmp_path, name)
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value).replace(f"{tmp_path}/", "")


@pytest.mark.parametrize(
    ("text", "name"),
    [
        (TOML, "m.toml"),
        (CSV, "m.csv"),
        (CSV.replace(",", ";"), "m.CSV"),
        (CSV.replace(",", "\t"), "m.csv"),
        ("# ours, all of them, by hand\n" + CSV.replace(",", ";"), "m.csv"),
        (b"\xef\xbb\xbf" + CSV.replace("\n", "\r\n").encode(), "m.csv"),
    ],
    ids=["toml", "comma", "semicolon", "tab", "remark", "windows"],
)
def test_toml_and_csv_give_the_same_catalogue(text: str | bytes, name: str, tmp_path: Path) -> None:
    catalogue = read(text, tmp_path, name)
    car, fridge = catalogue.own
    assert (car.name, car.kind, car.data_ids, car.mass) == ("Sonata", Kind.VEHICLE, (30200005,), 1500.0)
    body = car.body
    assert (body.length, body.width, body.height) == (4.9, 1.86, 1.445)
    assert (body.wheelbase, body.rear_overhang, body.front_overhang) == (2.84, 1.1, 0.96)
    assert math.degrees(body.max_steer) == pytest.approx(35.0)
    assert (fridge.kind, fridge.data_ids, fridge.mass) == (Kind.OBSTACLE, (40100019, 40100020), None)
    assert (fridge.body.wheelbase, fridge.body.front_overhang) == (0.0, 0.35)


def test_user_models_override_built_in_ones_and_keep_the_others(tmp_path: Path) -> None:
    catalogue = read("name,class,length,width,height,DataID\nkia k5,vehicle,9,2,3,40100001\n", tmp_path, "m.csv")
    (own,) = catalogue.own
    assert catalogue.find("2015_Kia_K5") is find_model("2015_Kia_K5"), "its full name is another one"
    assert catalogue.find("Kia-K5") is own
    assert catalogue.of_data_id(40100001, Kind.VEHICLE) is own
    crate = catalogue.of_data_id(40100001, Kind.OBSTACLE)
    assert crate is not None
    assert crate.name == "Cargo_Box"
    catalogue = read("DataID,length,width,height\n20200012,5,2,2\n", tmp_path, "m.csv")
    model = catalogue.of_data_id(20200012, Kind.EGO)
    assert model is not None
    assert (model.name, model.body.length) == ("Model_20200012", 5.0)
    ours = BUILT_IN.of_data_id(20200012, Kind.EGO)
    assert ours is not None
    assert ours.name == "Hyundai_Ioniq_5"


def test_missing_vehicle_dimensions_are_scaled_from_the_default(tmp_path: Path) -> None:
    (truck,) = read("DataID,length,width,height\n30200099,12,2.5,3.5\n", tmp_path, "m.csv").own
    body = truck.body
    assert body.wheelbase == pytest.approx(7.248, abs=0.001)
    assert body.front_overhang + body.wheelbase + body.rear_overhang == pytest.approx(12.0)
    assert math.degrees(body.max_steer) == pytest.approx(36.25)


HEAD = "DataID,name,class,length,width,height,wheelbase,rear_overhang,max_steer,mass\n"


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("x,A,vehicle,4,2,1,,,,", "m.csv:2: DataID: expected a number such as 30200005, got 'x'"),
        ("0,A,vehicle,4,2,1,,,,", "m.csv:2: DataID: expected a number such as 30200005, got '0'"),
        ("99999999999,A,vehicle,4,2,1,,,,", "m.csv:2: DataID: expected a number such as 30200005, got '99999999999'"),
        ("1,A,tram,4,2,1,,,,", "m.csv:2: class: expected vehicle, pedestrian or obstacle, got 'tram'"),
        ("1,A,,4,2,1,,,,", "m.csv:2: class: missing; expected vehicle, pedestrian or obstacle"),
        (",,vehicle,4,2,1,,,,", "m.csv:2: name: missing; expected a name of at most 100 characters"),
        (",_,vehicle,4,2,1,,,,", "m.csv:2: name: expected a name of at most 100 characters, got '_'"),
        ("1,A,vehicle,,2,1,,,,", "m.csv:2: length: missing; expected a number from 0.01 to 100 [m]"),
        ("1,A,vehicle,4,-2,1,,,,", "m.csv:2: width: expected a number from 0.01 to 100 [m], got '-2'"),
        ("1,A,vehicle,4,2,nan,,,,", "m.csv:2: height: expected a number from 0.01 to 100 [m], got 'nan'"),
        ("1,A,vehicle,4500,2,1,,,,", "m.csv:2: length: expected a number from 0.01 to 100 [m], got '4500'"),
        ("1,A,vehicle,4,2,1,3,1.5,,", "m.csv:2: rear_overhang: expected wheelbase and rear overhang to be at most the"),
        ("1,A,vehicle,4,2,1,5,,,", "m.csv:2: wheelbase: expected wheelbase and rear overhang to be at most the length"),
        ("1,A,vehicle,4,2,1,,,0.6,", "m.csv:2: max_steer: expected a number from 1 to 80 [deg], got '0.6'"),
        ("1,A,vehicle,4,2,1,,,,1e9", "m.csv:2: mass: expected a number from 0 to 1e+06 [kg], got '1e9'"),
        ("1,A,obstacle,4,2,1,3,,,", "m.csv:2: wheelbase: expected no value: only vehicles have it"),
        ("1,A,vehicle,4,2,1,,,,,7", "m.csv:2: expected 10 columns, got 11"),
        ('1,"A,vehicle,4,2,1', "m.csv:3: not valid CSV: unexpected end of data"),
        ("", "m.csv: expected at least one model, below a first line DataID,name,class,length,width,height,...; found"),
    ],
)
def test_csv_error_names_line_and_field(row: str, message: str, tmp_path: Path) -> None:
    assert refusal(f"{HEAD}{row}\n", tmp_path, "m.csv").startswith(message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[model]]\nname = 'A'\nclass = 'vehicle'\nlength = 'x'\nwidth = 2\nheight = 1", "m.toml:4: length: expected"),
        (
            "\n[[model]]\nname = 'A'",
            "m.toml:2: class: missing; expected vehicle, pedestrian or obstacle; m.toml:2: length:",
        ),
        (
            "[[model]]\nlenght = 4",
            "m.toml:2: 'lenght': expected one of DataID, name, class, length, width, height,",
        ),
        ("[[model]]\nname = 7\nclass = 'car'", "m.toml:2: name: expected a name of at most 100 characters, got 7"),
        ("[[model]]\nDataID = true", "m.toml:2: DataID: expected a number such as 30200005, got true"),
        ("[[model]]\nDataID = [1, {}]", "m.toml:2: DataID: expected a number such as 30200005, got an object"),
        (
            "[[model]]\nDataID = [0]\nname = 'A'\nclass = 'car'\nlength = 4\nwidth = 2\nheight = 1",
            "m.toml:2: DataID: expected a number such as 30200005, got 0",
        ),
        ("model = [{name = 'A'}, 5]", "m.toml: model 2: expected a table, got 5"),
        ("model = 5", "m.toml: model: expected [[model]], with two brackets, for each model"),
        ("[model]\nname = 'A'", "m.toml: model: expected [[model]], with two brackets, for each model"),
        ("[[models]]", "m.toml: models: expected [[model]] tables and nothing else"),
        ("x = ", "m.toml: not valid TOML: Invalid value at its end"),
        ("x = " + "9" * 5_000, "m.toml: expected numbers of at most 4300 digits"),
        ("x = " + "[" * 5_000, "m.toml: nested too deeply"),
        ("", "m.toml: expected at least one model, such as [[model]] with DataID = 30200005"),
        (b"[[model]]\nname = '\xb5'", "m.toml:2: expected UTF-8 text"),
        (b" " * (2**20 + 1), "m.toml: expected a catalogue; it is longer than 1MiB"),
    ],
)
def test_toml_error_names_line_and_field(text: str | bytes, message: str, tmp_path: Path) -> None:
    assert refusal(text, tmp_path, "m.toml").startswith(message)


def test_unknown_and_duplicate_columns_are_errors(tmp_path: Path) -> None:
    text = refusal("DataID,lenght\n", tmp_path, "m.csv")
    assert text.startswith("m.csv:1: 'lenght': expected one of DataID, name,")
    assert text.endswith("(did you mean length?)")
    assert refusal("Data ID,data_id\n1,2\n", tmp_path, "m.csv") == "m.csv:1: DataID: given twice"


def test_duplicate_model_names_both_places(tmp_path: Path) -> None:
    rows = "1,A,vehicle,4,2,1,,,,\n2,a,vehicle,4,2,1,,,,\n1,B,vehicle,4,2,1,,,,\n1,C,obstacle,4,2,1,,,,\n"
    text = refusal(HEAD + rows, tmp_path, "m.csv")
    assert text == ("m.csv:3: name: 'a' is already used at m.csv:2; m.csv:4: DataID: 1 is already used at m.csv:2")
    tables = "[[model]]\nname='A'\nclass='car'\nlength=4\nwidth=2\nheight=1\n"
    text = refusal(tables * 2, tmp_path, "m.toml")
    assert text.startswith("m.toml:8: name: 'A' is already used at ")


def test_number_of_reported_errors_is_bounded(tmp_path: Path) -> None:
    text = refusal(HEAD + "x\n" * 50, tmp_path, "m.csv")
    assert text.count("; m.csv:") == 19
    assert text.endswith(" more")


def test_missing_file_and_unknown_suffix_are_errors(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"gone\.csv: cannot be read: No such file or directory"):
        read_catalogue(tmp_path / "gone.csv")
    with pytest.raises(DocumentError, match=r"expected a catalogue in a file named \*\.toml or \*\.csv"):
        read_catalogue(tmp_path / "cars.xlsx")
    with pytest.raises(DocumentError, match="cannot be read: Is a directory"):
        read_catalogue(_folder(tmp_path / "d.csv"))


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


@examples(60)
@given(text=st.text(st.sampled_from("[]=,;\"'\n #model30.A-"), max_size=60), is_toml=st.booleans())
def test_any_text_gives_a_catalogue_or_one_error_line(
    text: str,
    is_toml: bool,  # noqa: FBT001 - drawn
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder = tmp_path_factory.mktemp("any")
    name, before = ("m.toml", "[[model]]\n") if is_toml else ("m.csv", HEAD)
    told = ""
    try:
        read(before + text, folder, name)
    except DocumentError as error:
        told = str(error)
    assert len(told.splitlines()) <= 1
