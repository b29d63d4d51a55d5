"""Device profiles: each is sourced, and says what the product's own file says."""

from dataclasses import replace
from pathlib import Path

import pytest

import eds
from eds.datatypes import DATA_TYPES
from eds.profile import QUANTITIES, Profile, profile_of, profiles
from eds.shipped import shipped

UNITS = {"temperature": "°C", "voltage": "V", "brake": ""}
BY_EDS = [one for one in profiles() if one.eds is not None]


def by_name(name: str) -> Profile:
    return next(one for one in profiles() if one.name == name)


@pytest.mark.parametrize("profile", profiles(), ids=lambda one: one.name)
def test_each_entry_names_its_source_its_type_and_a_known_unit(profile: Profile) -> None:
    assert profile.products or profile.mark is not None, "it would fit nothing"
    types = {one.name for one in DATA_TYPES.values() if one.kind in ("signed", "unsigned")}
    for name, one in (*profile.quantities.items(), *profile.gains.items()):
        assert len(one.source) > 10, name
        assert one.type in types
        assert 0x2000 <= one.index < 0x6000, "what is the standard's needs no profile"
    assert set(profile.quantities) <= set(QUANTITIES)
    assert all(one.unit == UNITS[name] for name, one in profile.quantities.items())
    assert all(len(one.source) > 10 and one.text for one in profile.quirks)


@pytest.mark.parametrize("profile", BY_EDS, ids=lambda one: one.name)
def test_the_file_of_the_product_has_every_object_with_the_type_that_the_profile_claims(
    profile: Profile,
) -> None:
    description = eds.load(eds.locate(profile.eds or "", None), 5)
    assert profile_of(description) is profile
    assert profile.found(description) == (profile.quantities, profile.gains)


def test_the_files_that_ship_without_a_profile_are_those_of_no_drive_with_a_1018h() -> None:
    alone = {name for name in shipped() if profile_of(eds.load(eds.locate(name, None), 5)) is None}
    assert alone == {"gait_controller.eds", "inclinometer.eds", "schunk_prl.eds"}


def test_another_product_of_the_vendor_is_only_taken_where_it_has_the_mark_of_the_family() -> None:
    elmo = eds.load(eds.locate("elmo_gold.dcf", None), 5)
    other = replace(elmo, product_code=0x12345)
    assert profile_of(other) is by_name("Elmo Gold")
    assert profile_of(replace(elmo, vendor_id=0x99)) is None
    assert profile_of(replace(elmo, vendor_id=None)) is None
    assert profile_of(replace(other, vendor_id=0xFB)) is None  # maxon's, but no EPOS4
    trinamic = eds.load(eds.locate("trinamic_tmcm_1270.eds", None), 5)
    assert profile_of(replace(trinamic, product_code=0x4F7)) is None


def test_an_object_of_another_type_is_not_taken_for_the_one_that_is_meant(tmp_path: Path) -> None:
    text = eds.locate("elmo_gold.dcf", None).read_text(encoding="latin-1")
    at = text.index("[22A3sub1]")
    other = text[:at] + text[at:].replace("DataType=0x0006", "DataType=0x0008", 1)
    path = tmp_path / "elmo.dcf"
    path.write_text(other, encoding="latin-1")
    assert profile_of(eds.load(path, 5)) is None
