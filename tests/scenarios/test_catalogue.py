from __future__ import annotations

import pytest

from rosbridge_sim.scenarios.catalogue import (
    BUILT_IN,
    CATALOGUE,
    DEFAULT_EGO,
    Model,
    default_model,
    find_model,
)
from rosbridge_sim.world.state.world import Kind


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ("2016_Hyundai_Ioniq", "2016_Hyundai_Ioniq"),
        ("2016 hyundai-ioniq", "2016_Hyundai_Ioniq"),
        ("Hyundai Ioniq", "2016_Hyundai_Ioniq"),
        ("HYUNDAI_IONIQ5", "Hyundai_Ioniq_5"),
        ("2016_Kia_Niro(HEV)", "2016_Kia_Niro(HEV)"),
        ("kia niro hev", "2016_Kia_Niro(HEV)"),
        ("traffic cone", "Traffic_Cone"),
        (" Cargo-Box ", "Cargo_Box"),
    ],
)
def test_names_are_found_regardless_of_case_and_separators(asked: str, name: str) -> None:
    model = find_model(asked)
    assert model is not None
    assert model.name == name


@pytest.mark.parametrize("asked", ["", "_", "Spaceship", "2017_Kia_K5", "2016", "트럭", "x" * 100_000])
def test_an_unknown_name_finds_nothing(asked: str) -> None:
    assert find_model(asked) is None


def test_names_and_numbers_of_models_are_unique() -> None:
    for model in CATALOGUE:
        assert find_model(model.name) is model
        assert find_model(model.name.lower().replace("_", " ")) is model
        for data_id in model.data_ids:
            assert BUILT_IN.of_data_id(data_id, model.kind) is model


def test_known_models_have_the_documented_numbers() -> None:
    cone = BUILT_IN.of_data_id(40100005, Kind.OBSTACLE)
    assert cone is not None
    assert cone.name == "Traffic_Cone"
    ioniq5 = BUILT_IN.of_data_id(20200012, Kind.EGO)
    assert ioniq5 is not None
    assert ioniq5.body.wheelbase == 3.0
    assert BUILT_IN.of_data_id(40100005, Kind.VEHICLE) is None
    assert BUILT_IN.of_data_id(30200001, Kind.VEHICLE) is None


def test_top_speeds_are_the_documented_ones_to_the_bit() -> None:
    """They are part of the state hash: a factor in place of the quotient differs in the last bit."""
    assert default_model(Kind.EGO).body.top_speed == 185 / 3.6


@pytest.mark.parametrize("kind", Kind)
def test_every_kind_has_a_default_of_its_own_kind(kind: Kind) -> None:
    assert default_model(kind).kind is (Kind.VEHICLE if kind is Kind.EGO else kind)
    assert default_model(Kind.EGO) is DEFAULT_EGO


def test_dimensions_equal_the_published_ones() -> None:
    wheelbases = {model.name: model.body.wheelbase for model in CATALOGUE if model.kind is Kind.VEHICLE}
    published = {
        "2016_Hyundai_Ioniq": 2.700,
        "2016_Kia_Niro(HEV)": 2.700,
        "Hyundai_Ioniq_5": 3.000,
        "2015_Kia_K5": 2.795,
        "2014_Kia_K7": 2.890,
        "2016_Genesis_DH": 3.010,
        "2021_VW_Golf_GTI": 2.631,
        "2020_Kia_Stinger": 2.905,
    }
    assert {name: wheelbases[name] for name in published} == published


@pytest.mark.parametrize("model", CATALOGUE, ids=lambda model: model.name)
def test_body_dimensions_are_consistent(model: Model) -> None:
    body = model.body
    assert body.length == pytest.approx(body.front_overhang + body.wheelbase + body.rear_overhang)
    assert 0.0 < body.width <= 2.5
    assert 0.0 < body.height <= 4.0


def test_overlong_name_finds_nothing() -> None:
    assert find_model("2016_Hyundai_Ioniq") is not None
    assert find_model("2016_Hyundai_Ioniq" + " " * 10_000) is None


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("2015_Kia_K6", "2015_Kia_K5"),
        ("Hyundai Ionik 5", "Hyundai_Ioniq_5"),
        ("Pedestrain", "Pedestrian"),
        ("zeppelin", ""),
        ("x" * 10**6, ""),
    ],
)
def test_nearest_model_is_suggested(name: str, near: str) -> None:
    assert BUILT_IN.suggest(name).endswith("; /sim/catalogue lists all")
    assert BUILT_IN.suggest(name).startswith(f" (did you mean {near}?)" if near else "; it has 2016_Hyundai_Ioniq, ")
    assert not near or find_model(near) is not None


def test_models_of_a_make_are_suggested_where_none_is_near() -> None:
    kias = " (did you mean 2016_Kia_Niro(HEV) or 2015_Kia_K5 or 2014_Kia_K7?); /sim/catalogue lists all"
    assert BUILT_IN.suggest("kia sportage 2.0 diesel hybrid") == kias
    assert BUILT_IN.suggest("x" * 10**6).startswith("; it has ")
