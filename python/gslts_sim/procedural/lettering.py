"""Capital letters and figures of 3 x 5 dots, for prints, labels and displays."""

from __future__ import annotations

import numpy as np

from gslts.types import Bools
from gslts_sim.procedural.noise import Colour, Image

# Five rows of three dots; each octal digit is a row.
_ROWS = {
    "A": "25755", "B": "65656", "C": "34443", "D": "65556", "E": "74647", "F": "74644",
    "G": "34553", "H": "55755", "I": "72227", "J": "11152", "K": "55655", "L": "44447",
    "M": "57755", "N": "65555", "O": "25552", "P": "65644", "Q": "25563", "R": "65655",
    "S": "34216", "T": "72222", "U": "55557", "V": "55552", "W": "55775", "X": "55255",
    "Y": "55222", "Z": "71247", "0": "75557", "1": "26227", "2": "71747", "3": "71717",
    "4": "55711", "5": "74717", "6": "74757", "7": "71111", "8": "75757", "9": "75717",
    ":": "02020", " ": "00000", ".": "00002", "-": "00700", "+": "02720", "%": "51245",
}  # fmt: skip


def letters(text: str) -> Bools:
    """Return the dots of a line of text.

    Args:
        text: Capital letters, figures and signs of `_ROWS`.

    Returns:
        [5, 4 n - 1] bool, True where there is ink.
    """
    dots = np.zeros((5, 4 * len(text)), np.bool_)
    for i, character in enumerate(text):
        for row, digit in enumerate(_ROWS[character]):
            for column in range(3):
                dots[row, 4 * i + column] = int(digit) >> (2 - column) & 1
    return dots[:, :-1]


def write(
    image: Image, text: str, corners: tuple[float, float, float, float], colour: Colour
) -> None:
    """Write a line of text into a rectangle, as large as it fits.

    Args:
        image: [h,w,3] float32, changed in place.
        text: Capital letters, figures and signs of `_ROWS`.
        corners: Left, top, right and bottom, each 0 to 1.
        colour: sRGB.
    """
    h, w = image.shape[:2]
    left, top, right, bottom = corners
    dots = letters(text)
    room_down, room_across = (bottom - top) * h, (right - left) * w
    scale = int(min(room_down / 5, room_across / dots.shape[1]))
    if scale < 1:
        return  # Too small to be read.
    ink = dots.repeat(scale, axis=0).repeat(scale, axis=1)
    y = round(top * h + (room_down - ink.shape[0]) / 2)
    x = round(left * w + (room_across - ink.shape[1]) / 2)
    image[y : y + ink.shape[0], x : x + ink.shape[1]][ink] = colour


def write_lines(
    image: Image,
    rng: np.random.Generator,
    corners: tuple[float, float, float, float],
    lines: int,
    colour: Colour,
) -> None:
    """Fill a rectangle with lines of marks that look like small print.

    Args:
        image: [h,w,3] float32, changed in place.
        rng: Random stream.
        corners: Left, top, right and bottom, each 0 to 1.
        lines: Their number.
        colour: sRGB.
    """
    h, w = image.shape[:2]
    left, top, right, bottom = corners
    x0, x1 = round(left * w), round(right * w)
    pitch = (bottom - top) * h / lines
    for line in range(lines):
        y = round(top * h + line * pitch)
        height = max(1, round(pitch * 0.5))
        marks = np.repeat(rng.random(max(1, (x1 - x0) // 2 + 1)) < 0.72, 2)[: x1 - x0]
        if line == lines - 1:
            marks[len(marks) // 2 :] = False
        image[y : y + height, x0:x1][:, marks] = colour
