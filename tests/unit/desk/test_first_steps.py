"""The steps to a first step: each counts once, in whatever order it comes."""

from server_gui.core.desk.first_steps import FirstStep, FirstSteps


def test_each_step_is_told_once_with_the_time_that_it_took() -> None:
    now, told = [10.0], list[tuple[FirstStep, float]]()
    steps = FirstSteps(lambda step, took_s: told.append((step, took_s)), clock=lambda: now[0])
    assert not steps.is_over
    now[0] = 11.5
    for _ in range(2):
        steps.reach(FirstStep.WINDOW)
    assert told == [(FirstStep.WINDOW, 1.5)]
    assert steps.now is FirstStep.SIMULATOR
    for step in FirstStep:
        steps.reach(step)
    assert steps.is_over
    assert [step for step, _ in told] == [
        FirstStep.WINDOW,
        *(step for step in FirstStep if step is not FirstStep.WINDOW),
    ]


def test_a_robot_that_is_not_to_walk_has_no_such_step() -> None:
    steps = FirstSteps(steps=(FirstStep.SIMULATOR, FirstStep.DATA))
    for step in (FirstStep.WALK, FirstStep.DATA, FirstStep.SIMULATOR):
        steps.reach(step)
    assert steps.is_over
    assert FirstStep.WALK not in steps.took_s
