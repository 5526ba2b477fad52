import numpy as np
import pytest

import troupe
from troupe.intent import Intent, locomotions


def test_only_changes_are_sent_and_sequences_count_up() -> None:
    intent = Intent()
    assert list(intent.commands("a")) == [], "a new character stands by itself"
    intent.wanted = troupe.Locomotion((0, 0, 1), style="old")
    (first,) = intent.commands("a")
    assert (first.session_id, first.sequence, first.locomote.style) == ("a", 1, "old")
    assert list(intent.commands("a")) == []
    # The same, said without the style, is no change.
    intent.wanted = troupe.Locomotion((0, 0, 1))
    assert list(intent.commands("a")) == []
    intent.wanted = troupe.Locomotion()
    (second,) = intent.commands("a")
    assert second.sequence == 2 and not second.locomote.HasField("velocity")


def test_acts_go_once_and_leave_locomotion_alone() -> None:
    intent = Intent()
    intent.wanted = troupe.Locomotion((0, 0, 1))
    intent.act(troupe.interact("stool", variant="upright"))
    kinds = [command.WhichOneof("intent") for command in intent.commands("a")]
    assert kinds == ["locomote", "interact"]
    assert list(intent.commands("a")) == []
    intent.wanted = troupe.Locomotion((0, 0, 1))
    assert [command.sequence for command in intent.commands("a")] == [3], "it is to walk again"


def test_what_may_not_have_arrived_is_sent_again_with_its_style() -> None:
    intent = Intent()
    intent.wanted = troupe.Locomotion((0, 0, 1), style="old")
    list(intent.commands("a"))
    intent.doubt()
    (again,) = intent.commands("a")
    assert again.locomote.style == "old"
    assert list(intent.commands("a")) == []


def test_a_session_that_is_taken_up_goes_on() -> None:
    intent = Intent(5)
    assert list(intent.commands("a")) == []
    intent.wanted = troupe.Locomotion()
    assert [command.sequence for command in intent.commands("a")] == [6]


def test_unsent_commands_come_again_in_order() -> None:
    intent = Intent()
    intent.act(troupe.drop())
    intent.act(troupe.cancel())
    for command in reversed(list(intent.commands("a"))):
        intent.unsent(command)
    assert [command.WhichOneof("intent") for command in intent.commands("a")] == ["drop", "cancel"]


def test_a_priority_is_sent_alone() -> None:
    intent = Intent()
    intent.set_priority(0.9)
    (command,) = intent.commands("a")
    assert command.WhichOneof("intent") is None and command.priority == pytest.approx(0.9)
    assert list(intent.commands("a")) == []


def test_arrays_become_intents() -> None:
    before = [troupe.Locomotion(style="old"), troupe.Locomotion()]
    made = locomotions([[0, 0, 1], [1, 0, 0]], [np.nan, 0.5], [None, "proud"], before)
    assert made[0] == troupe.Locomotion((0.0, 0.0, 1.0), style="old")
    assert made[1] == troupe.Locomotion((1.0, 0.0, 0.0), facing=0.5, style="proud")
    with pytest.raises(troupe.InvalidArgumentError) as caught:
        locomotions([[0, 0, 1]], None, None, before)
    assert (caught.value.field, caught.value.allowed) == ("velocities", "(2, 3)")
    with pytest.raises(troupe.InvalidArgumentError, match="finite"):
        locomotions([[0, 0, np.nan], [0, 0, 0]], None, None, before)


def test_a_skill_is_an_act() -> None:
    act = troupe.skill("lie-down", variant="back")
    assert act.command.WhichOneof("intent") == "skill"
    assert (act.command.skill.name, act.command.skill.variant) == ("lie-down", "back")
    assert not act.lets_move
