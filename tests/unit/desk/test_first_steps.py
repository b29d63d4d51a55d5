"""The steps to a first step: each counts once, in whatever order it comes."""

from server_gui.core.desk.first_steps import FirstSteps, Step


def test_each_step_is_told_once_with_the_time_that_it_took() -> None:
    now, told = [10.0], list[tuple[Step, float]]()
    steps = FirstSteps(lambda step, took_s: told.append((step, took_s)), clock=lambda: now[0])
    assert not steps.is_over
    now[0] = 11.5
    for _ in range(2):
        steps.reach(Step.WINDOW)
    assert told == [(Step.WINDOW, 1.5)]
    assert steps.now is Step.SIMULATOR
    for step in Step:
        steps.reach(step)
    assert steps.is_over
    assert [step for step, _ in told] == [Step.WINDOW, *(step for step in Step if step is not Step.WINDOW)]


def test_a_robot_that_is_not_to_walk_has_no_such_step() -> None:
    steps = FirstSteps(steps=(Step.SIMULATOR, Step.DATA))
    for step in (Step.WALK, Step.DATA, Step.SIMULATOR):
        steps.reach(step)
    assert steps.is_over
    assert Step.WALK not in steps.took_s
