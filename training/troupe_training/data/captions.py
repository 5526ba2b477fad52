"""Captions by templates: what a clip shows in many wordings, the same for the same seed.

Content and style are said by synonyms, and sometimes what was measured is added: duration, pace, turn, hand. Captions are small
letters, digits and spaces. Names that the tables do not have are said as they are.
"""

import random
from dataclasses import dataclass

import numpy as np

from troupe_training.data.facts import Facts


@dataclass(frozen=True)
class Wording:
    """How a content is said: verb phrases in the base form, and nouns with their article."""

    verbs: tuple[str, ...]
    nouns: tuple[str, ...]
    travels: bool = False  # so a caption can name its pace


CONTENTS = {
    "walk": Wording(("walk", "walk forward", "stroll", "walk ahead"), ("a walk", "a walking motion"), True),
    "walk-back": Wording(("walk backward", "walk backwards", "step back"), ("a backward walk",), True),
    "walk-left": Wording(("walk to the left", "sidestep left", "walk left"), ("a walk to the left",), True),
    "walk-right": Wording(("walk to the right", "sidestep right", "walk right"), ("a walk to the right",), True),
    "walk-turn-left": Wording(
        ("walk and turn left", "turn left while walking", "walk and turn to the left"),
        ("a walk with a left turn",),
        True,
    ),
    "walk-turn-right": Wording(
        ("walk and turn right", "turn right while walking", "walk and turn to the right"),
        ("a walk with a right turn",),
        True,
    ),
    "run": Wording(("run", "run forward", "jog"), ("a run", "a running motion"), True),
    "dash": Wording(("dash", "sprint", "dash forward"), ("a dash", "a sprint"), True),
    "wave-left-hand": Wording(
        ("wave the left hand", "wave with the left hand", "wave a left hand"), ("a wave of the left hand",)
    ),
    "wave-right-hand": Wording(
        ("wave the right hand", "wave with the right hand", "wave a right hand"), ("a wave of the right hand",)
    ),
    "wave-both-hands": Wording(
        ("wave both hands", "wave with both hands", "wave two hands"), ("a wave of both hands",)
    ),
    "raise-up-left-hand": Wording(
        ("raise the left hand", "lift the left hand", "put the left hand up", "raise the left arm"),
        ("a raise of the left hand",),
    ),
    "raise-up-right-hand": Wording(
        ("raise the right hand", "lift the right hand", "put the right hand up", "raise the right arm"),
        ("a raise of the right hand",),
    ),
    "raise-up-both-hands": Wording(
        ("raise both hands", "lift both hands", "put both hands up", "raise both arms"), ("a raise of both hands",)
    ),
    "bow": Wording(("bow", "take a bow", "bow politely"), ("a bow",)),
    "bye": Wording(("wave goodbye", "say goodbye"), ("a goodbye",)),
    "byebye": Wording(("wave bye bye", "wave goodbye again and again"), ("a long goodbye",)),
    "guide": Wording(("show the way", "guide someone", "point the way"), ("a gesture that shows the way",)),
    "call": Wording(("call someone", "beckon"), ("a call",)),
    "respond": Wording(("respond", "answer a call"), ("a response",)),
    "kick": Wording(("kick", "throw a kick"), ("a kick",)),
    "punch": Wording(("punch", "throw a punch"), ("a punch",)),
    "slash": Wording(("slash", "swing a sword", "slash with a sword"), ("a slash", "a sword swing")),
    "dance-short": Wording(("dance", "dance for a moment"), ("a short dance", "a dance")),
    "dance-long": Wording(("dance", "dance for a while"), ("a long dance", "a dance")),
}


@dataclass(frozen=True)
class Manner:
    """How a style is said."""

    adverbs: tuple[str, ...]
    adjectives: tuple[str, ...]  # of a person and of a motion


STYLES = {
    "active": Manner(("actively", "with energy", "energetically"), ("active", "energetic")),
    "normal": Manner(("normally", "in a normal way", "casually"), ("normal", "ordinary")),
    "elderly": Manner(("like an elderly person", "with old age"), ("elderly", "aged")),
    "old": Manner(("like an old person", "like someone very old"), ("old",)),
    "exhausted": Manner(("exhaustedly", "with exhaustion", "worn out"), ("exhausted", "worn out")),
    "tired": Manner(("tiredly", "in a tired way"), ("tired", "weary")),
    "feminine": Manner(("in a feminine way", "like a lady"), ("feminine", "ladylike")),
    "masculine": Manner(("in a masculine way", "in a manly way"), ("masculine", "manly")),
    "youthful": Manner(("in a youthful way", "like a young person", "youthfully"), ("youthful", "young")),
    "angry": Manner(("angrily", "with anger", "in anger"), ("angry", "furious")),
    "childish": Manner(("childishly", "like a child"), ("childish", "childlike")),
    "chimpira": Manner(("like a thug", "like a gangster"), ("thuggish",)),
    "giant": Manner(("like a giant", "as heavy as a giant"), ("gigantic", "giant")),
    "happy": Manner(("happily", "with joy"), ("happy", "cheerful")),
    "musical": Manner(("musically", "to a rhythm", "as in a musical"), ("musical", "rhythmic")),
    "not-confident": Manner(("without confidence", "shyly", "timidly"), ("shy", "timid")),
    "proud": Manner(("proudly", "with pride"), ("proud", "haughty")),
    "sad": Manner(("sadly", "with sorrow"), ("sad", "unhappy")),
}
WHO = ("person", "character", "figure", "human")
PRONOUNS = ("someone", "somebody", "he", "she")
ASKING = ("make a {who}", "make the {who}", "show a {who} who will", "let the {who}", "please", "now", "")
GERUNDS = {
    "run": "running",
    "sidestep": "sidestepping",
    "jog": "jogging",
    "step": "stepping",
    "put": "putting",
    "swing": "swinging",
}
NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
PACES = ((0.6, "at a slow pace"), (1.4, "at a moderate pace"), (2.4, "at a fast pace"), (99.0, "at a very fast pace"))
TURN_LEAST_RAD = 0.7
TAIL_SHARE = 0.35  # of captions say something that was measured


def third(phrase: str) -> str:
    """``walk and turn left`` to ``walks and turns left``."""
    verb, _, rest = phrase.partition(" ")
    ends = ("s", "sh", "ch", "x")
    verb = verb[:-1] + "ies" if verb.endswith("ry") else verb + ("es" if verb.endswith(ends) else "s")
    rest = rest.replace("and turn ", "and turns ")
    return f"{verb} {rest}".strip()


def gerund(phrase: str) -> str:
    """``wave both hands`` to ``waving both hands``."""
    verb, _, rest = phrase.partition(" ")
    verb = GERUNDS.get(verb) or (verb[:-1] if verb.endswith("e") else verb) + "ing"
    rest = rest.replace("and turn ", "and turning ")
    return f"{verb} {rest}".strip()


def article(words: str) -> str:
    """The words with ``a`` or ``an`` before them."""
    return ("an " if words[0] in "aeiou" else "a ") + words


def wording(content: str) -> Wording:
    """How a content is said; one that the table does not have by its own name."""
    plain = content.replace("-", " ")
    return CONTENTS.get(content) or Wording((plain,), (article(plain),))


def manner(style: str) -> Manner:
    """How a style is said; one that the table does not have by its own name."""
    plain = style.replace("-", " ")
    return STYLES.get(style) or Manner((f"in a {plain} way",), (plain,))


def style_phrases() -> list[str]:
    """Every wording of a style, the longest first."""
    phrases = {phrase for style in STYLES.values() for phrase in (*style.adverbs, *style.adjectives)}
    return sorted(phrases, key=lambda phrase: (-len(phrase.split()), phrase))


def unstyled(text: str, phrases: list[str]) -> str | None:
    """A caption without the style that it names; none if it names no style.

    ``phrases`` are wordings of styles, the longest first. "an angry person walks" becomes "a person walks".
    """
    left, kept = text.split(), []
    while left:
        ends = (len(phrase.split()) for phrase in phrases if left[: len(phrase.split())] == phrase.split())
        length = next(ends, 0)
        if length == 0:
            kept.append(left[0])
        left = left[max(1, length) :]
    if len(kept) == len(text.split()):
        return None
    for place, after in enumerate(kept[1:]):
        if kept[place] in ("a", "an"):
            kept[place] = article(after).split()[0]
    return " ".join(kept)


def _tail(facts: Facts, rng: random.Random) -> str:
    """Something that was measured."""
    tails = []
    seconds = round(facts.seconds)
    if 1 <= seconds < len(NUMBERS):
        unit = "second" if seconds == 1 else "seconds"
        tails += [f"for {NUMBERS[seconds]} {unit}", f"for about {NUMBERS[seconds]} {unit}"]
    if wording(facts.content).travels:
        tails += [next(pace for most, pace in PACES if facts.speed_mps < most)]
    if abs(facts.turn_rad) > TURN_LEAST_RAD and "turn" not in facts.content:
        tails += [f"turning {'left' if facts.turn_rad > 0 else 'right'} on the way"]
    if facts.hand is not None and "hand" not in facts.content and not wording(facts.content).travels:
        tails += [f"with the {facts.hand} hand"]
    return rng.choice(tails) if tails else ""


def caption(facts: Facts, seed: int, stated: float = 1.0) -> str:
    """One wording of the facts; ``stated`` is the chance that it names the style."""
    rng = random.Random(seed)
    said = wording(facts.content)
    verb = rng.choice(said.verbs)
    adverb = adjective = ""
    if facts.style is not None and rng.random() < stated:
        adverb, adjective = (
            rng.choice(words) for words in (manner(facts.style).adverbs, manner(facts.style).adjectives)
        )
    who = rng.choice(WHO)
    described = article(f"{adjective} {who}".strip())
    text = rng.choice(
        (
            f"{article(who)} {third(verb)} {adverb}",
            f"{described} {third(verb)}",
            f"{described} is {gerund(verb)}",
            f"{article(who)} is {gerund(verb)} {adverb}",
            f"{rng.choice(PRONOUNS)} {third(verb)} {adverb}",
            f"{rng.choice(ASKING).format(who=who)} {verb} {adverb}",
            f"{gerund(verb)} {adverb}",
            f"{rng.choice(said.nouns)} {adverb}",
            f"{described} {third(verb)}",
            f"{verb} {adverb}",
        )
    )
    if rng.random() < TAIL_SHARE:
        text += " " + _tail(facts, rng)
    return " ".join(text.split())


def plain_captions(content: str, style: str | None) -> list[str]:
    """Every wording of a content and a style with nothing measured, in one template: what retrieval compares with."""
    adverbs = manner(style).adverbs if style is not None else ("",)
    return sorted({f"a person {third(verb)} {adverb}".strip() for verb in wording(content).verbs for adverb in adverbs})


def numpy_seed(*parts: int) -> int:
    """One seed of several numbers, the same on every machine."""
    return int(np.random.SeedSequence(list(parts)).generate_state(1)[0])
