"""A robot that is left: its session ends, it is followed no more, and the others go on."""

from pathlib import Path

from gateway.client import Address
from server_gui.core.fleet.collector import Collector
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from tests.fake_robot import FakeRobot
from tests.support.waiting import until


def test_a_robot_that_is_left_is_followed_no_more_and_the_others_are(tmp_path: Path) -> None:
    settings = ServerSettings(
        recorder=RecordingSettings(spool=tmp_path / "spool"), store=StoreSettings(str(tmp_path / "store"))
    )
    with FakeRobot() as one, FakeRobot() as other, Collector(settings) as collector:
        collector.follow("one", Address.parse(one.address)).result()
        collector.follow("other", Address.parse(other.address)).result()
        until(lambda: one.called("stream.start") and other.called("stream.start"), "followed both")
        collector.leave("one").result()
        until(lambda: set(collector.report().result().robots) == {"other"}, "left one")
        collector.wait(0.0)
        again = len(one.called("stream.start"))
        collector.follow("one", Address.parse(one.address)).result()
        until(lambda: len(one.called("stream.start")) > again, "followed it again")
