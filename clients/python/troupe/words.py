"""Words that become motion, and motion that becomes words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from troupe.arrays import floats
from troupe.clip import Clip
from troupe.errors import AnswerError, InvalidArgumentError
from troupe.inbetween import keyframes
from troupe.keyframe import Keyframe
from troupe.pack import Pack
from troupe.v1 import motion_pb2


class Sound(IntEnum):
    """The samples of a sound."""

    MUSIC = 0
    """Music, for dances."""
    SPEECH = 1
    """Speech, for gestures."""


@dataclass(frozen=True)
class Audio:
    """Audio as the codes of a pack."""

    sound: Sound
    codes: Sequence[int]
    """Oldest first, each below the pack's number of audio codes."""

    def to_message(self) -> motion_pb2.Audio:
        """The audio on the wire."""
        sounds = {Sound.MUSIC: motion_pb2.SOUND_MUSIC, Sound.SPEECH: motion_pb2.SOUND_SPEECH}
        return motion_pb2.Audio(sound=sounds[self.sound], codes=self.codes)


@dataclass(frozen=True)
class Sampling:
    """How a language model chooses tokens. None: as the pack says."""

    temperature: float | None = None
    """0 takes the most likely token; above 0 one is drawn with the seed, up to 2."""
    top_k: int | None = None
    """How many of the likeliest tokens may be drawn; 0 for all of them."""
    top_p: float | None = None
    """The likeliest tokens that may be drawn are together at least so likely: above 0, up to 1 for all of them."""
    repetition: float | None = None
    """Divides the logits of the last tokens: 1 changes nothing, up to 10."""

    def to_message(self) -> motion_pb2.Sampling:
        """The sampling on the wire."""
        return motion_pb2.Sampling(
            temperature=self.temperature, top_k=self.top_k, top_p=self.top_p, repetition=self.repetition
        )


@dataclass(frozen=True, eq=False)
class Agent:
    """A second character of a motion, and more."""

    text: str
    """Words for its motion. All characters have words, or none has."""
    past: Clip | Sequence[Keyframe] = ()
    """Frames that go before, as many as those of the first character."""


@dataclass(frozen=True, eq=False)
class Prompt:
    """Words to act out, for packs with the capability `text`."""

    text: str = ""
    """Words for the motion. Empty beside a past, targets or audio: the model decides."""
    seconds: float | None = None
    """Length of the motion. None, and without `frames`: the model decides."""
    frames: int | None = None
    """Length of the motion in frames of the pack, in the place of `seconds`."""
    targets: Clip | Sequence[Keyframe] = ()
    """Frames that come after: the motion leads from the past to them. Then its length must be given."""
    to: Sequence[float] | None = None
    """(3) x and z of the place where the motion ends, metres, and the heading there, radians; in the place of `targets`."""
    others: Sequence[Agent] = ()
    """Other characters of the same motion, for packs with the capability `agents`."""
    audio: Audio | None = None
    """The sound to dance or to speak to."""
    flow_steps: int | None = None
    """Steps of the pack's flow decoder, whose frames are finer and come in one part. None or 0: the plain decoder."""

    def to_message(self) -> motion_pb2.Prompt:
        """The goal on the wire."""
        others = [
            motion_pb2.Agent(text=other.text, past=keyframes(other.past, f"goal.prompt.others[{nth}].past", None))
            for nth, other in enumerate(self.others)
        ]
        audio = None if self.audio is None else self.audio.to_message()
        targets = keyframes(self.targets, "goal.prompt.targets", None)
        if self.to is not None:
            if targets:
                message = "to: is given beside targets; allowed: one of the two"
                raise InvalidArgumentError(message, field="to", allowed="one of the two")
            x, z, heading = floats("to", self.to, (3,)).tolist()
            place = Keyframe(root=(x, 0.0, z), heading=heading)
            targets = [place.to_message("goal.prompt.targets[0]")]
        return motion_pb2.Prompt(
            text=self.text,
            seconds=self.seconds,
            frame_count=self.frames,
            targets=targets,
            others=others,
            audio=audio,
            flow_steps=self.flow_steps,
        )


def describe_request(
    pack: Pack, motion: Clip, others: Sequence[Clip], into: Sound | None, seed: int, sampling: Sampling | None
) -> motion_pb2.DescribeRequest:
    """The request for words of a motion; for audio where a sound is named."""
    telling = {
        None: motion_pb2.TELLING_WORDS,
        Sound.MUSIC: motion_pb2.TELLING_MUSIC,
        Sound.SPEECH: motion_pb2.TELLING_SPEECH,
    }
    return motion_pb2.DescribeRequest(
        pack=pack.name,
        frames=keyframes(motion, "frames", pack),
        others=[
            motion_pb2.OtherMotion(frames=keyframes(other, f"others[{nth}].frames", pack))
            for nth, other in enumerate(others)
        ],
        into=telling[into],
        seed=seed,
        sampling=None if sampling is None else sampling.to_message(),
    )


class Description:
    """Parts of a description as they come, up to the last."""

    def __init__(self) -> None:
        self.ended = False

    def words(self, part: motion_pb2.DescribeResponse) -> str:
        """Reads words."""
        self.ended = part.is_last
        if part.WhichOneof("part") != "text":
            raise AnswerError("a part has no text", field="part")
        return part.text

    def codes(self, part: motion_pb2.DescribeResponse) -> list[int]:
        """Reads codes of audio."""
        self.ended = part.is_last
        if part.WhichOneof("part") != "audio":
            raise AnswerError("a part has no audio", field="part")
        return list(part.audio.codes)

    def check_end(self) -> None:
        """Refuses an answer that ended before its last part."""
        if not self.ended:
            raise AnswerError("the answer ended before its last part", field="is_last")
