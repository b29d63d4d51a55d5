"""An alarm's details are left out a thing at a time, where there is less room."""

from server_gui.views.alarms.words import fewer


def test_of_much_to_check_the_first_thing_is_kept_where_not_all_of_it_has_room() -> None:
    said = ["since 07:28:21, for 4 s · robot: it walks", "→ check its power; check its encoder"]
    shorter = fewer(said)
    assert shorter[0] == " · ".join(said)
    assert shorter[2] == "since 07:28:21 · → check its power; check its encoder", (
        "for how long goes before words"
    )
    assert shorter[-11:] == (
        "since 07:28:21, for 4 s · → check its power; check its …",
        "since 07:28:21 · → check its power; check its …",
        "since 07:28:21, for 4 s · → check its power; check …",
        "since 07:28:21 · → check its power; check …",
        "since 07:28:21, for 4 s · → check its power …",
        "since 07:28:21 · → check its power …",
        "→ check its power; check its …",
        "→ check its power; check …",
        "→ check its power …",
        "since 07:28:21, for 4 s",
        "",
    )
