"""The page of models: listed by names, compared, trained, and promoted only when that is confirmed."""

import dataclasses
import itertools
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton, QTreeWidgetItem

from ml.registry.card import Bin, Card, ClassScore, Metrics
from ml.registry.registry import Registry
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.jobs import Job, JobState
from server_gui.core.models.models import Tone
from server_gui.core.models.training import NOT_COMPARED, Trained
from server_gui.core.prediction.adaptation import AdaptationState, Adapting, Tried
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.marks import day_and_time
from server_gui.views.models.models_table import SIGNED
from server_gui.views.models.panel import ModelsPage
from server_gui.views.theme import Theme
from tests.gui.archives import Shown
from tests.gui.fakes import Bench, destroy
from tests.unit.registry.models import card, learned
from tests.unit.registry.test_registry import NOWHERE
from tests.unit.training.walkers import day, put


def metrics(f1: float, right: float) -> Metrics:
    return Metrics(
        figures={"macro_f1": f1},
        per_class={"steady": ClassScore(1.0, 1.0, f1, 40), "fall": ClassScore(0.0, 0.0, 0.0, 0)},
        per_subject={"Ada": f1},
        calibration=(Bin(0.9, right, 40),),
        calibration_error=0.1,
    )


@pytest.fixture
def registry(store_libraries: None, settings: ServerSettings, monkeypatch: pytest.MonkeyPatch) -> Registry:
    monkeypatch.setattr(Registry.__init__, "__defaults__", (NOWHERE,))
    return Registry(settings.store.url)


def publish(registry: Registry, seed: int, f1: float) -> Card:
    model = learned(seed=seed)
    made = card(model, metrics=metrics(f1, f1), held_out=("mon",))
    return registry.card(registry.publish(model.state(), made))


@pytest.fixture
def both(registry: Registry) -> tuple[Card, Card]:
    """One that serves, and a newer and better one that serves nobody."""
    one, other = publish(registry, 0, 0.8), publish(registry, 1, 0.9)
    registry.promote(one.id, who="Ada", why="first")
    return one, other


def opened(whole: Shown) -> ModelsPage:
    whole.open("Models")
    page = whole.window.tabs.models
    whole.until(lambda: page.rows.rows, "listed the models")
    whole.draw()
    return page


def choose(whole: Shown, page: ModelsPage, model: Card) -> None:
    for row in range(page.table.model().rowCount()):
        page.table.selectRow(row)
        if page.chosen is not None and page.chosen.card.id == model.id:
            whole.draw()
            return
    raise AssertionError(model.id)


def click(button: QPushButton) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def figures(page: ModelsPage) -> dict[str, list[str]]:
    """What stands beside each name of the comparison."""
    found: dict[str, list[str]] = {}

    def take(item: QTreeWidgetItem) -> None:
        found[item.text(0)] = [item.text(column) for column in range(1, item.columnCount())]
        for place in range(item.childCount()):
            below = item.child(place)
            assert below is not None
            take(below)

    for place in range(page.compare.table.topLevelItemCount()):
        top = page.compare.table.topLevelItem(place)
        assert top is not None
        take(top)
    return found


def test_models_are_listed_and_compared_by_names_instead_of_hashes(
    shown: Shown, both: tuple[Card, Card]
) -> None:
    page = opened(shown)
    one, other = both
    choose(shown, page, other)
    cells = [
        str(page.rows.index(row, column).data())
        for row in range(page.rows.rowCount())
        for column in range(page.rows.columnCount())
    ]
    words = " ".join([*cells, page.compare.said.text(), page.compare.other.currentText()])
    assert all(model.id not in words for model in both)
    assert "Falling of" in words
    rows = {entry.card.id: row for row, entry in enumerate(page.rows.rows)}
    signed = {model.id: page.rows.index(rows[model.id], SIGNED).data() for model in both}
    assert signed == {one.id: "unsigned", other.id: "–"}
    assert page.compare.other.currentData() == one.id
    assert page.compare.other.currentText().endswith("(serves)")
    found = figures(page)
    assert found["F1, mean over classes"][:4] == ["90.0 %", "80.0 %", "+10.0", "▲ better"]
    assert found["Ada"][:4] == ["90.0 %", "80.0 %", "+10.0", "▲ better"]
    assert found["fall"] == ["–", "–", "–", "", "0"]
    assert "90 % said 90 % right" in page.compare.plot.accessibleDescription()
    assert "not known" in page.compare.week.text()


def test_what_is_known_of_a_store_that_is_away_promotes_nothing(
    shown: Shown, both: tuple[Card, Card], archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, (_, other) = opened(shown), both
    choose(shown, page, other)
    assert page.promote.isEnabled()
    monkeypatch.setattr(archive.models.reach, "problem", "there is no store any more")
    shown.draw()
    assert page.chosen is not None, "it is still listed"
    for button in (page.promote, page.back):
        assert not button.isEnabled()
        assert "is not reached" in button.toolTip()


def test_the_page_knows_of_a_store_that_is_gone_before_its_first_frame(
    shown: Shown, both: tuple[Card, Card], archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, (_, other) = opened(shown), both
    choose(shown, page, other)
    assert page.promote.isEnabled()
    shown.open("Recordings")
    monkeypatch.setattr(archive.models.reach, "problem", "there is no store any more")
    page.show()
    assert not page.promote.isEnabled(), "as the rest of the window knows"
    assert page.state.text().startswith("▲ The store is not reached")
    assert "as known at " in page.compare.note, "also where the list is out of sight"


def test_what_training_has_said_of_a_model_is_read_again_before_it_is_promoted(
    shown: Shown, both: tuple[Card, Card], archive: Archive
) -> None:
    page, (_, other) = opened(shown), both
    why = ("not compared with the one that serves: its sessions lack 12 of its channels",)
    archive.models.trained[other.id] = Trained(other.id, NOT_COMPARED, why)
    choose(shown, page, other)
    click(page.promote)
    shown.until(page.confirm.isVisible, "asked")
    assert "lack 12 of its channels" in page.confirm.words.text()
    assert "on 1 person never seen)" in page.confirm.words.text()


def test_classes_that_would_be_lost_stand_out_before_a_promotion_and_beside_the_other(
    shown: Shown, both: tuple[Card, Card], theme: Theme, monkeypatch: pytest.MonkeyPatch
) -> None:
    for place in ("core.models.changes", "views.models.compare"):
        monkeypatch.setattr(f"server_gui.{place}.unknown_to", lambda *_: "It does not know stairs.")
    page, (_, other) = opened(shown), both
    choose(shown, page, other)
    click(page.promote)
    shown.until(page.confirm.isVisible, "asked")
    assert page.confirm.yes.text() == "Promote without these classes"
    assert (page.confirm.yes.objectName(), page.confirm.no.objectName()) == ("", "primary")
    for said in (page.confirm.warning, page.compare.warning):
        assert said.isVisible()
        assert said.text() == "▲ It does not know stairs."
        assert said.palette().windowText().color() == theme.colour("warn")


def test_the_list_of_models_is_as_high_as_its_rows(shown: Shown, both: tuple[Card, Card]) -> None:
    page, (one, _) = opened(shown), both
    choose(shown, page, one)
    last = page.table.visualRect(page.table.model().index(page.table.model().rowCount() - 1, 0))
    assert 0 <= page.table.viewport().height() - last.bottom() < last.height()


def test_a_model_serves_only_once_that_was_confirmed(
    shown: Shown, both: tuple[Card, Card], registry: Registry, archive: Archive
) -> None:
    page, (one, other) = opened(shown), both
    choose(shown, page, other)
    click(page.promote)
    shown.until(page.confirm.isVisible, "asked")
    assert "Serves now: Falling of" in page.confirm.words.text()
    assert not page.promote.isEnabled()
    assert registry.serving("falling") == one.id
    click(page.confirm.no)
    shown.until(lambda: not page.confirm.isVisible(), "changed nothing")
    click(page.promote)
    shown.until(page.confirm.isVisible, "asked again")
    page.confirm.why.setText("judged better")
    click(page.confirm.yes)
    shown.until(lambda: archive.models.tone is Tone.GOOD, "promoted it")
    assert [each.model for each in registry.history("falling")] == [one.id, other.id]
    assert registry.history("falling")[-1].why == "judged better"
    click(page.back)
    shown.until(page.confirm.isVisible, "asked before it went back")
    assert page.confirm.yes.text() == "Roll back"
    click(page.confirm.yes)
    shown.until(lambda: registry.serving("falling") == one.id, "rolled back")


def test_what_serves_already_is_said_and_a_refusal_is_a_sentence(
    shown: Shown, both: tuple[Card, Card], archive: Archive
) -> None:
    page, (one, _) = opened(shown), both
    choose(shown, page, one)
    click(page.promote)
    shown.until(lambda: "nothing changes" in page.said.text(), "said that it serves")
    assert not page.confirm.isVisible()
    page.robot.setCurrentIndex(page.robot.findData("exo-01"))
    click(page.back)
    shown.until(lambda: page.said.property("tone") == "bad", "refused")
    assert "exo-01: falling has no model of its own" in page.said.text()


def test_a_training_shows_how_far_it_is_while_the_window_draws_and_serves_nobody(
    whole: Shown, settings: ServerSettings, archive: Archive, registry: Registry, tmp_path: Path
) -> None:
    put(settings.store.url, tmp_path / "walks", [day(f"s{n}", n, each_s=5.0) for n in range(4)])
    whole.open("Models")
    page = whole.window.tabs.models
    click(page.new)
    whole.until(lambda: "Nobody is chosen" in page.form.said.text(), "said what is labelled")
    judges = page.form.judges
    (judge,) = judges.findItems("s3", Qt.MatchFlag.MatchExactly)
    middle = judges.visualItemRect(judge).center()
    for turned in (True, False, True):
        QTest.mouseClick(judges.viewport(), Qt.MouseButton.LeftButton, pos=middle)
        assert (judges.chosen == ("s3",)) is turned, "its whole row is what is clicked"
    QTest.keyClick(judges, Qt.Key.Key_Space)
    assert judges.chosen == ()
    QTest.keyClick(judges, Qt.Key.Key_Space)
    whole.until(lambda: "Judged by s3" in page.form.said.text(), "said by whom it is judged")
    others = [item for name in ("s1", "s2") for item in judges.findItems(name, Qt.MatchFlag.MatchExactly)]

    def turn_others() -> None:
        for middle in [judges.visualItemRect(item).center() for item in others]:
            QTest.mouseClick(judges.viewport(), Qt.MouseButton.LeftButton, pos=middle)

    turn_others()
    whole.until(lambda: "it takes two to learn from" in page.form.said.text(), "said that too few are left")
    assert page.form.said.property("tone") == "warn"
    turn_others()
    whole.until(lambda: "Judged by s3;" in page.form.said.text(), "said that enough are left again")
    assert page.form.said.property("tone") == ""
    click(page.form.begin)
    (job,) = archive.models.jobs.jobs
    whole.draw()
    assert not page.form.begin.isEnabled()
    assert page.form.jobs.isVisible()
    whole.until(lambda: job.done > 0, "said how far it is")
    whole.until(lambda: job.is_over, "ended")
    assert job.state is JobState.DONE
    assert ". Not compared with the model that came with GWRMS: " in job.said
    whole.until(lambda: page.chosen, "listed and chose it")
    assert page.chosen is not None
    assert list(archive.models.trained) == [page.chosen.card.id]
    assert page.said.property("tone") == "good", "it was trained"
    said = page.said.text().replace("\u00a0", " ")
    assert said == f"Trained activity for every robot: {job.said}"
    assert job.said not in page.compare.notes.text(), "it is said once"
    assert not {"▼ worse", "▲ better"} & set(itertools.chain.from_iterable(figures(page).values()))
    assert not page.form.isVisible(), "what came of it is looked at next"
    assert " % on s3 alone, whom it has not seen (always guessing the same: " in said
    assert registry.history("activity") == []


def test_too_few_wearers_are_said_in_words(
    shown: Shown, settings: ServerSettings, archive: Archive, registry: Registry, tmp_path: Path
) -> None:
    put(settings.store.url, tmp_path / "walks", [day("s0", 0, each_s=5.0)])
    shown.open("Models")
    page = shown.window.tabs.models
    click(page.new)
    click(page.form.begin)
    shown.until(lambda: archive.models.jobs.jobs[0].is_over, "gave up")
    shown.until(lambda: "it takes two to learn from and one to judge by" in page.said.text(), "said why")
    assert page.said.property("tone") == "bad"


def away(self: Registry, task: str | None = None) -> list[Card]:
    """Fail as a look at a store does that does not answer."""
    raise OSError("s3://lab cannot be reached: Connection refused")


def test_a_store_that_is_gone_leaves_what_was_known_and_says_how_many_and_of_when(
    shown: Shown, both: tuple[Card, Card], archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = opened(shown)
    assert page._list.note == "2 models"
    known_s = archive.models.known_s
    assert known_s is not None

    monkeypatch.setattr(Registry, "entries", away)
    archive.models.look(now=True)
    shown.until(lambda: "Connection refused" in page.state.text(), "said so")
    assert page.state.isVisible()
    when = day_and_time(known_s)
    assert f"Below is what was known at {when}, 2 models; there may be others by now" in page.state.text()
    assert page._list.note == f"The list of models is not read: 2 models as known at {when}"
    assert page.rows.rowCount() == 2
    assert archive.models.known_s == known_s, "it is no newer for having been asked for"
    assert not page.promote.isEnabled()
    assert "nothing can be promoted" in page.promote.toolTip()


def test_a_store_that_was_never_read_may_have_more_than_what_is_listed(
    shown: Shown, both: tuple[Card, Card], archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Registry, "entries", away)
    shown.open("Models")
    page = shown.window.tabs.models
    shown.until(lambda: "Connection refused" in page.state.text(), "said so")
    assert page._list.note == "The list of models is not read: 0 models at least"
    assert "It was not read yet: there may be more than the 0 models below" in page.state.text()
    assert "No model is known here" not in page.state.text()


@pytest.mark.parametrize("scale", [1.5, 1.0])
def test_every_control_of_the_page_fits_into_its_width_at_large_text(
    whole: Shown, both: tuple[Card, Card], theme: Theme, scale: float
) -> None:
    theme.set(scale=scale)
    page = opened(whole)
    page.new.setChecked(True)
    whole.window.resize(1024, 700)
    whole.draw()
    whole.draw()
    assert page.robot.width() >= page.robot.sizeHint().width()
    for control in (page.new, page.robot, page.promote, page.back, page.compare.other, page.form.begin):
        corner = control.mapTo(page, control.rect().bottomRight())
        assert corner.x() <= page.visibleRegion().boundingRect().right(), control
        assert control.height() >= control.minimumSizeHint().height(), control


def test_the_jobs_of_training_hold_up_no_other(archive: Archive) -> None:
    assert archive.models.jobs is not archive.jobs
    assert isinstance(archive.models.jobs.add("Train", lambda job: "done"), Job)


def test_a_copy_that_has_learned_from_the_wearer_is_told_with_since_when_and_how_to_end_it(
    theme: Theme, archive: Archive, bench: Bench
) -> None:
    page = ModelsPage(archive.models, theme, bench.desk)
    page.show()
    serving = Adapting("exo-01", 7, AdaptationState.SERVING, "P01", tried=Tried(3.4, 2.1, 34), since_s=0.0)
    for state, said in (
        (AdaptationState.SERVING, "serves since"),
        (AdaptationState.TRYING, "does not serve"),
        (AdaptationState.OFF, ""),
    ):
        bench.station.take_prediction(dataclasses.replace(serving, state=state))
        page._show_learned()
        assert said in page.learned.text()
        assert ("exo-01: learned from P01" in page.learned.text()) is bool(said)
        assert page.learned.isVisible() is bool(said)
    bench.station.take_prediction(serving)
    page._show_learned()
    assert "“Take back” in the window" in page.learned.text()
    destroy(page)


def is_in_sight(button: QPushButton) -> bool:
    return button.visibleRegion().boundingRect() == button.rect()


def test_what_decides_is_in_sight_as_soon_as_it_is_asked_on_a_small_screen(
    whole: Shown, both: tuple[Card, Card], theme: Theme
) -> None:
    theme.set(scale=1.5)
    whole.window.resize(1024, 700)
    page, (_, other) = opened(whole), both
    choose(whole, page, other)
    click(page.promote)
    whole.until(page.confirm.isVisible, "asked")
    whole.until(lambda: all(map(is_in_sight, (page.confirm.yes, page.confirm.no))), "scrolled to it")
    click(page.confirm.no)
    whole.until(lambda: not page.confirm.isVisible(), "changed nothing")
    click(page.new)
    whole.until(lambda: is_in_sight(page.form.begin), "scrolled to what begins it")
