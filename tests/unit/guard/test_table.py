"""The manual's table of rules is the product's own."""

from pathlib import Path

import pytest

from gateway.config.guard import WATCHES
from gateway.guard.table import table

MANUAL = (Path(__file__).parents[3] / "docs" / "reference" / "guard.md").read_text(encoding="utf-8")


def test_the_manual_has_the_table_as_it_is_drawn() -> None:
    assert f"\n\n{table()}\n\n" in MANUAL, table()


def test_every_rule_has_a_row_and_every_key_of_it_stands_there() -> None:
    rows = {row.split("`")[1]: row for row in table().splitlines()[2:]}
    assert set(rows) == set(WATCHES)
    for name, watch in WATCHES.items():
        for key in watch.rule.__struct_fields__[5:]:  # behind those that every rule has
            assert f"`{key}`" in rows[name]


@pytest.mark.parametrize(
    ("rule", "keys"),
    [
        ("current", "**`above`** (A), `hysteresis` (A), `for_s`"),
        ("sync_lost", "**`period_s`**, `tolerance_s` (0.05), `can_id` (0x080)"),
        ("bus", "`silent_s` (0.5)"),
    ],
)
def test_a_key_is_drawn_with_its_unit_and_default_and_bold_where_it_is_needed(rule: str, keys: str) -> None:
    (row,) = [row for row in table().splitlines() if row.startswith(f"| `{rule}` |")]
    assert row.endswith(f" | {keys} |")
