"""Resources: asked for only while they are looked at; the table keeps what people have done to it."""

import dataclasses
import re
import time
from collections.abc import Iterator

import numpy as np
import pytest
from msgspec.structs import replace
from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QApplication

from gateway.client import ConnectionState
from gateway.wire.cost import BudgetInfo, ClientCost, GatewayCost
from gateway.wire.resource import ProcessUse, Throttling
from server_gui.core.desk.busiest import Busiest, busiest
from server_gui.core.follow.events import Costs, LinkChanged, without_processes
from server_gui.views.resources.computer import held_back
from server_gui.views.resources.page import Resources
from server_gui.views.resources.processes import COMMAND, CPU, MEMORY, NAME, PID, ProcessTable
from server_gui.views.resources.trend import Trend
from server_gui.views.theme import Theme
from server_gui.views.widgets.plot import Curve
from server_gui.views.widgets.wrapping_legend import WrappingLegend
from tests.gui.fakes import Bench, destroy
from tests.support.desk import resources

MIB = 1 << 20


@pytest.fixture
def view(theme: Theme, bench: Bench) -> Iterator[Resources]:
    made = Resources(bench.desk, theme)
    made.resize(900, 600)
    made.show()
    yield made
    destroy(made)


def show(view: Resources, bench: Bench, *uses: ProcessUse) -> list[str]:
    """The names in the table's order, after a look."""
    bench.station.take([resources(uses)])
    for _ in range(6):
        view.refresh()
    table = view.table.sorted
    return [str(table.index(row, NAME).data()) for row in range(table.rowCount())]


def use(name: str, pid: int, cpu: float | None, memory: int = MIB) -> ProcessUse:
    return ProcessUse(pid, name, cpu, memory)


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_a_legend_breaks_a_long_name_and_never_its_number(theme: Theme, scale: float) -> None:
    theme.set(scale=scale)
    legend = WrappingLegend("values")
    legend.say([("#ffffff", "━", "gateway, of one core % 10.7"), ("#ffffff", "━", f"{'x' * 60} 93.4")])
    legend.show()
    for width in (90, 140, 230, 600):
        legend.resize(round(width * scale), 200)
        QApplication.processEvents()
        text = QTextDocument()
        text.setDefaultFont(legend.font())
        text.setHtml(legend.text())
        text.setTextWidth(legend.contentsRect().width())
        text.setDocumentMargin(0)
        assert text.idealWidth() <= legend.width(), width
        assert {"10.7", "93.4"} <= set(text.toPlainText().replace("\N{NO-BREAK SPACE}", " ").split())
    destroy(legend)


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_no_legend_takes_the_room_of_its_plot(view: Resources, theme: Theme, scale: float) -> None:
    """Of what is called at length each has a line; the name is cut in its middle, its number is whole."""
    theme.set(scale=scale)
    view.resize(theme.px(540), theme.px(500))
    names = [f"python -m a.program.with.a.long.name --of {number}" for number in range(4)]
    curves = [Curve(name, "accent") for name in names]
    times = np.arange(10.0)
    for _ in range(3):
        view.top.show_rows(view, times, curves, [np.full(10, 1234.5)] * 4, live=True)
        QApplication.processEvents()
    legend, plot = view.top.legend, view.top.plot
    assert plot.height() >= theme.px(60)
    assert legend.height() >= legend._height, "lines are cut"
    lines = legend._height / legend.fontMetrics().lineSpacing()
    assert lines < 5, "one line each"
    assert legend.text().count("1234.5") == 4


def test_every_title_of_the_resources_is_whole_where_they_are_narrow(view: Resources, theme: Theme) -> None:
    for scale in (1.0, 1.5):
        theme.set(scale=scale)
        view.resize(theme.px(320), 900)
        QApplication.processEvents()
        for card in (view.cpu, view.memory, view.top, view.devices, view.temperature):
            title = card._title
            assert title.fontMetrics().horizontalAdvance(title.text()) <= title.contentsRect().width()


def test_before_the_first_look_nothing_is_counted(view: Resources) -> None:
    view.refresh()
    assert view._processes.note == "no data yet"


def test_two_of_one_interpreter_are_told_apart_by_what_they_run(view: Resources, bench: Bench) -> None:
    lines = (
        "/usr/bin/python3 -m gwrms gateway r.toml",
        "/usr/bin/python3 walk.py",
        "/usr/bin/python3 walk.py",
    )
    bench.station.take([resources()])
    show(view, bench, *(ProcessUse(pid, "python3", 9.0, MIB, line) for pid, line in enumerate(lines, 7)))
    names = [curve.channel for curve in view.top.plot._curves]
    assert names == ["gwrms gateway", "walk.py 8", "walk.py 9"]


def test_who_uses_most_is_known_without_the_table(bench: Bench) -> None:
    most = ProcessUse(7, "python3", 88.0, MIB, "/usr/bin/python3 /opt/bin/gwrms gateway")
    looked = resources([use("idle", 1, 0.1), most])
    bench.station.take([without_processes(looked)])
    assert bench.station.processes is None
    assert busiest(bench.station) == Busiest("gwrms gateway", 88.0)


def test_processes_are_asked_for_only_while_they_are_visible(view: Resources, bench: Bench) -> None:
    assert bench.first.named("show_processes") == [(True,)]
    view.hide()
    assert bench.first.named("show_processes") == [(True,), (False,)]


def test_another_robot_is_asked_instead(view: Resources, bench: Bench) -> None:
    other = bench.add("exo-02", 7421)
    bench.desk.select(other)
    assert bench.first.named("show_processes") == [(True,), (False,)]
    assert bench.commands[1].named("show_processes") == [(True,)]


def test_the_table_sorts_both_ways_on_every_column(view: Resources, bench: Bench) -> None:
    uses = use("b", 2, 5.0, 3 * MIB), use("a", 10, None, 1 * MIB), use("c", 1, 50.0, 2 * MIB)
    assert show(view, bench, *uses) == ["c", "b", "a"], "the highest CPU is not at the top"
    for column, rising in (
        (NAME, ["a", "b", "c"]),
        (PID, ["c", "b", "a"]),
        (CPU, ["a", "b", "c"]),
        (MEMORY, ["a", "c", "b"]),
    ):
        view.table.sortByColumn(column, Qt.SortOrder.AscendingOrder)
        assert show(view, bench, *uses) == rising
        view.table.sortByColumn(column, Qt.SortOrder.DescendingOrder)
        assert show(view, bench, *uses) == rising[::-1]


def test_a_look_keeps_the_selected_process_wherever_it_goes(view: Resources, bench: Bench) -> None:
    show(view, bench, *(use(f"p{pid}", pid, float(pid)) for pid in range(60)))
    table = view.table
    place = next(row for row in range(60) if table.sorted.index(row, NAME).data() == "p20")
    table.selectRow(place)
    table.verticalScrollBar().setValue(25)
    show(view, bench, *(use(f"p{pid}", pid, 100.0 - pid) for pid in range(5, 60)))
    assert [index.data() for index in table.selectionModel().selectedRows()] == ["p20"]
    assert table.verticalScrollBar().value() == 25


def test_a_pid_that_another_program_has_now_is_another_row(view: Resources, bench: Bench) -> None:
    show(view, bench, use("old", 7, 1.0))
    assert show(view, bench, use("new", 7, 1.0)) == ["new"]


def test_who_causes_what_monitoring_costs_is_told_until_the_link_drops(view: Resources, bench: Bench) -> None:
    watch = replace(client("watch", 1.5), sent_bytes_per_s=None)
    clients = [watch, client("gwrms gui", 3.25), client("new", None)]
    cost = GatewayCost(0, 5.0, 20 << 20, 3, 410.2, {}, {}, clients, BudgetInfo(8.0, 4))
    bench.station.take([resources(), Costs(cost)])
    show(view, bench, use("python3", 7, 1.0))
    told = view.facts.text().splitlines()
    at = told.index("Monitoring wakes the computer 410 times a second; for")
    assert told[at + 1 : at + 3] == [
        "   gwrms gui: 3.2 % of a core, 12 KiB/s",
        "   watch: 1.5 % of a core, – KiB/s",
    ]
    assert told[at + 3] == "▲ To keep to its budget the robot sends one row of 4"
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no route", time.monotonic_ns())])
    show(view, bench, use("python3", 7, 1.0))
    assert "Monitoring" not in view.facts.text()


def client(who: str, cpu_percent: float | None) -> ClientCost:
    rate = None if cpu_percent is None else 12288.0
    return ClientCost(who, cpu_percent, rate, rate, rate, 0, [])


def test_disk_network_heat_and_who_uses_the_cpu_are_shown_over_time(view: Resources, bench: Bench) -> None:
    bench.station.take([resources()])
    for percent in (10.0, 40.0):
        show(view, bench, use("gait_ctrl", 1, percent), use("<b>", 2, 5.0), use("idle", 3, None))
    assert bench.station.processing.resource.devices.recent().shape == (2, 6)
    cards = (view.devices, view.temperature, view.top)
    told = {card: card.legend.text().replace("&nbsp;", " ") for card in cards}
    assert re.findall(r"━ ([^<]+) ([\d.]+)<", told[view.devices]) == [
        ("disk read", "20.0"),
        ("written", "4.0"),
        ("network in", "1.0"),
        ("out", "64.0"),
    ]
    assert re.findall(r"━ ([^<]+) ([\d.]+) °C<", told[view.temperature]) == [("hottest", "61.5")]
    assert re.findall(r"━ ([^<]+) ([\d.]+)<", told[view.top]) == [
        ("gait_ctrl", "40.0"),
        ("&lt;b&gt;", "5.0"),
    ]


def test_a_computer_without_a_sensor_of_heat_has_no_empty_card(view: Resources, bench: Bench) -> None:
    bench.station.take([resources()])
    for thermal, is_there in (({}, False), ({"core": 61.5}, True)):
        seen = resources([use("gait_ctrl", 1, 10.0)])
        bench.station.take([dataclasses.replace(seen, snapshot=replace(seen.snapshot, thermal=thermal))])
        view.read_now()
        view.refresh()
        assert view.temperature.isVisible() is is_there
        assert (view._grid.indexOf(view.temperature) >= 0) or not is_there


def test_what_holds_the_cores_back_is_told(bench: Bench) -> None:
    seen = resources([]).snapshot
    assert held_back(None) == ""
    assert held_back(seen) == "slowest core at 80 % of its frequency"
    hot = Throttling(3, {"processor": 0.4, "fan": 0.0}, [None])
    assert (
        held_back(replace(seen, throttling=hot))
        == "▲ too hot 3× since its start · ▲ processor holds back 40 %"
    )
    assert held_back(replace(seen, throttling=Throttling(None, {}, []))) == "the cores are not throttled"


def test_who_leaks_is_said(view: Resources, bench: Bench) -> None:
    for minute in range(60):
        for part in range(2):
            seen = resources([use("gait_ctrl", 1, 1.0, (50 + minute) * MIB)]).snapshot
            stamp_ns = round((minute * 60 + part * 30) * 1e9)
            bench.station.processing.resource.take(replace(seen, stamp_ns=stamp_ns))
    bench.station.robot.apply(resources())
    for _ in range(6):
        view.refresh()
    assert "▲ gait_ctrl (1) grows by 60.0 MiB an hour" in view.facts.text()


def test_a_first_look_has_no_percentages_and_says_so(view: Resources, bench: Bench) -> None:
    show(view, bench, use("a", 1, None))
    assert view.table.sorted.index(0, CPU).data() == "–"


def test_the_filter_finds_processes_by_name(view: Resources, bench: Bench) -> None:
    view.words.setText("gait")
    assert show(view, bench, use("gait_ctrl", 1, 1.0), use("sshd", 2, 1.0)) == ["gait_ctrl"]


def test_a_trend_without_rows_has_no_axis_that_would_measure_nothing(theme: Theme) -> None:
    trend = Trend(theme, "CPU (%)", 10.0)
    trend.show_rows("none", np.zeros(0), [Curve("cpu", "accent")], [np.zeros(0)], live=True)
    assert trend.plot._is_blank
    trend.show_rows("some", np.array([1.0, 2.0]), [Curve("cpu", "accent")], [np.array([3.0, 4.0])], live=True)
    assert not trend.plot._is_blank
    assert trend.plot.accessibleDescription() == "cpu 4.0"
    trend.show_rows("another", np.zeros(0), [Curve("cpu", "accent")], [np.zeros(0)], live=True)
    assert trend.plot._is_blank


LINES = (
    "/usr/bin/python3 -m gateway.main sim --scenario walk",
    "/usr/bin/python3 -m gateway.main sim --scenario stand",
    "bash /dev/fd/3",
    "bash /opt/robot/shots.sh 3",
)
CALLED = ["gateway.main sim 7", "gateway.main sim 8", "bash /dev/fd/3", "shots.sh 3"]


def test_a_process_has_one_name_in_table_curves_and_the_last_line(view: Resources, bench: Bench) -> None:
    names = ("python3", "python3", "bash", "bash")
    uses = [
        ProcessUse(7 + place, name, 90.0 - place, MIB, line)
        for place, (name, line) in enumerate(zip(names, LINES, strict=True))
    ]
    bench.station.take([resources()])
    assert show(view, bench, *uses) == CALLED
    assert [curve.channel for curve in view.top.plot._curves] == CALLED
    assert busiest(bench.station) == Busiest(CALLED[0], 90.0)
    without = ProcessUse(8, "python3", 95.0, MIB)
    bench.station.take([without_processes(resources([without]))])
    assert busiest(bench.station) == Busiest(CALLED[1], 95.0), (
        "a look without commands has no other name for it"
    )


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_names_of_processes_are_whole_and_the_command_is_left_out_before_them(
    theme: Theme, scale: float
) -> None:
    theme.set(scale=scale)
    table = ProcessTable(theme)
    uses = [ProcessUse(7 + place, "python3", 90.0, 530 * MIB, line) for place, line in enumerate(LINES)]
    table.resize(theme.px(360), theme.px(300))
    table.show()
    table.take(uses)
    QApplication.processEvents()
    assert table.isColumnHidden(COMMAND)
    assert table.columnWidth(NAME) >= table.sizeHintForColumn(NAME)
    shown = [column for column in range(5) if not table.isColumnHidden(column)]
    assert {NAME, CPU, MEMORY} <= set(shown)
    assert sum(map(table.columnWidth, shown)) <= table.viewport().width()
    table.resize(theme.px(700), theme.px(300))
    QApplication.processEvents()
    assert not table.isColumnHidden(COMMAND)
    assert not table.isColumnHidden(PID)
    destroy(table)
