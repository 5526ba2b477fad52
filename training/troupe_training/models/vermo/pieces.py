"""Text as byte-pair pieces, in the file format of the library `tokenizers`.

The file's own normalizer makes text small letters, digits and single spaces; anything else is dropped. Every letter and digit
is a piece, so any word can be written, in many pieces where the captions of the training did not have it.
"""

import string
from collections.abc import Iterable
from pathlib import Path

from tokenizers import Regex, Tokenizer, decoders, models, normalizers, pre_tokenizers, trainers

SPACE = "▁"  # a word's first piece begins with it
MOST_PIECES = 1000
DROPOUT = 0.1  # of merges in training, so that parts of words are seen as well (Provilkov et al. 2020)


def train_pieces(captions: Iterable[str], most: int = MOST_PIECES) -> Tokenizer:
    """Byte-pair pieces of captions, at most as many."""
    tokenizer = Tokenizer(models.BPE())
    tokenizer.normalizer = normalizers.Sequence(
        [
            normalizers.NFKD(),
            normalizers.StripAccents(),
            normalizers.Lowercase(),
            normalizers.Replace(Regex("['’]"), ""),
            normalizers.Replace(Regex("[^a-z0-9]+"), " "),
            normalizers.Strip(),
        ]
    )
    tokenizer.pre_tokenizer = pre_tokenizers.Metaspace(replacement=SPACE, prepend_scheme="always")
    tokenizer.decoder = decoders.Metaspace(replacement=SPACE, prepend_scheme="always")
    letters = [*string.ascii_lowercase, *string.digits, SPACE]
    trainer = trainers.BpeTrainer(vocab_size=most, initial_alphabet=letters, show_progress=False, special_tokens=[])
    tokenizer.train_from_iterator(captions, trainer)
    return tokenizer


def words_of(captions: Iterable[str]) -> list[str]:
    """The words that captions use, sorted."""
    return sorted({word for caption in captions for word in caption.split()})


class Pieces:
    """Text to ids and back; ``dropout`` of merges for training."""

    def __init__(self, tokenizer: Tokenizer):
        self.tokenizer = tokenizer
        self.count = tokenizer.get_vocab_size()

    @staticmethod
    def read(path: Path) -> "Pieces":
        """Out of a ``tokenizer.json``."""
        return Pieces(Tokenizer.from_file(str(path)))

    def save(self, path: Path) -> None:
        """Writes ``tokenizer.json``."""
        self.tokenizer.save(str(path), pretty=False)

    def varied(self) -> "Pieces":
        """The same pieces, with merges left out at random."""
        copied = Tokenizer.from_str(self.tokenizer.to_str())
        copied.model.dropout = DROPOUT
        return Pieces(copied)

    def ids(self, text: str) -> list[int]:
        """Ids of a text's pieces, from 0."""
        ids: list[int] = self.tokenizer.encode(text).ids
        return ids

    def text(self, ids: list[int]) -> str:
        """The text of ids."""
        text: str = self.tokenizer.decode(ids)
        return text
