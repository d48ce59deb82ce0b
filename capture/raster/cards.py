"""Cards with words, in the typeface that Pillow carries: pictures (h, w, 3) just large enough for what they say.

Sizes follow the height of the picture that a card is for. The same words give the same picture object, so that a window
can tell by identity what has to be drawn anew.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from capture.scene import Badge, Banner, Colour, Panel, Timeline
from devices.frame import frozen

Card = NDArray[np.uint8]

CARD: Colour = (0.965, 0.970, 0.980)
_EDGE: Colour = (0.80, 0.825, 0.855)
_INK, _PALE = (38, 44, 54), (88, 97, 112)
_ACCENT, _ACCENT_PALE = (38, 103, 190), (214, 227, 244)
_TRACK, _MARK = (205, 211, 220), (226, 120, 30)
_SMALL = 0.78
"""Letter height of tables over that of the rest."""
_BANNER = 0.66
"""The most that a line of a banner is long, over the height of the picture: the performer stands beside it."""
_MOST_KEPT = 96


def letter_height(picture_height: int) -> int:
    """Pixels, of plain words in a picture of that height."""
    return max(picture_height // 36, 10)


@lru_cache(maxsize=_MOST_KEPT)
def words_card(lines: tuple[str, ...], height: int, background: Colour, large: bool = False) -> Card:
    """Plain lines without a frame."""
    size = round(letter_height(height) * (1.25 if large else 1.0))
    pitch, font = round(1.35 * size), _font(size)
    width = max(_length(line, font) for line in lines)
    card, draw = _blank(width + 2, pitch * len(lines), background)
    for row, line in enumerate(lines):
        draw.text((0, row * pitch), line, fill=_INK if large else _PALE, font=font)
    return _done(card)


@lru_cache(maxsize=_MOST_KEPT)
def badges_card(badges: tuple[Badge, ...], height: int, background: Colour, across: bool = False) -> Card:
    """Dots with words, one under the other or in a row."""
    size = round(letter_height(height) * (_SMALL if across else 0.9))
    pitch, font, gap = round(1.5 * size), _font(size), round(1.1 * size)
    widths = [round(1.1 * size) + _length(badge.text, font) for badge in badges]
    total = sum(widths) + gap * (len(badges) - 1) if across else max(widths)
    card, draw = _blank(total + 2, pitch * (1 if across else len(badges)), background)
    left, top = 0, 0
    for badge, width in zip(badges, widths, strict=True):
        middle, radius = top + pitch / 2, 0.36 * size
        dot = (left + 1, middle - radius, left + 1 + 2 * radius, middle + radius)
        draw.ellipse(dot, fill=_bytes(badge.colour))
        draw.text((left + round(1.1 * size), top + pitch / 2), badge.text, fill=_PALE, font=font, anchor="lm")
        left, top = (left + width + gap, top) if across else (left, top + pitch)
    return _done(card)


@lru_cache(maxsize=_MOST_KEPT)
def table_card(rows: tuple[str, ...], height: int) -> Card:
    """A framed table, tabs between columns; the first row, and one after an empty one, is a heading.

    All columns but the first stand right.
    """
    size = round(letter_height(height) * _SMALL)
    pitch, font, gap, margin = round(1.42 * size), _font(size), round(1.1 * size), round(0.7 * size)
    cells = [row.split("\t") for row in rows]
    columns = max(map(len, cells))
    widths = [max((_length(row[c], font) for row in cells if c < len(row) > 1), default=0) for c in range(columns)]
    lone = max((_length(row[0], font) for row in cells if len(row) == 1), default=0)
    width = max(sum(widths) + gap * (columns - 1), lone)
    card, draw = _framed(width + 2 * margin, pitch * len(rows) + 2 * margin)
    for number, row in enumerate(cells):
        right, top = margin - gap, margin + number * pitch
        for column, text in enumerate(row):
            right += widths[column] + gap
            place, anchor = ((margin, top), "la") if column == 0 else ((right, top), "ra")
            heading = number == 0 or cells[number - 1] == [""]
            draw.text(place, text, fill=_ACCENT if heading else _INK, font=font, anchor=anchor)
    return _done(card)


@lru_cache(maxsize=_MOST_KEPT)
def keys_card(lines: tuple[str, ...], height: int) -> Card:
    """A framed list of keys in two columns; a line without a tab is a heading and begins a group."""
    size = round(letter_height(height) * _SMALL)
    pitch, font, margin = round(1.42 * size), _font(size), round(1.2 * size)
    columns = _halves(lines)
    keys = max(_length(line.split("\t")[0], font) for line in lines if "\t" in line) + size
    widths = [
        max(_length(c[-1], font) + keys * (len(c) - 1) for c in (line.split("\t") for line in column)) + 2 * size
        for column in columns
    ]
    card, draw = _framed(sum(widths) + 2 * margin - size, pitch * max(map(len, columns)) + 2 * margin)
    left = margin
    for column, width in zip(columns, widths, strict=True):
        for number, line in enumerate(column):
            key, _, meaning = line.partition("\t")
            top = margin + number * pitch
            draw.text((left, top), key, fill=_INK if meaning else _ACCENT, font=font)
            draw.text((left + keys, top), meaning, fill=_PALE, font=font)
        left += width
    return _done(card)


@lru_cache(maxsize=_MOST_KEPT)
def panel_card(panel: Panel, height: int) -> Card:
    """A framed list of settings, each with its value and a bar that shows where it is in its range."""
    size = round(letter_height(height) * _SMALL)
    pitch, font, margin = round(1.6 * size), _font(size), round(0.8 * size)
    names = max(_length(row.name, font) for row in panel.rows)
    values = max(_length(_spelled(row.value), font) for row in panel.rows)
    bar = 5 * size
    lines = [_spelled(line) for line in panel.foot]
    width = max(names + values + bar + 3 * size, *(_length(line, font) for line in lines), 0)
    foot = pitch * len(lines) + (size // 2 if lines else 0)
    card, draw = _framed(width + 2 * margin, pitch * len(panel.rows) + foot + 2 * margin)
    for number, row in enumerate(panel.rows):
        top, here = margin + number * pitch, number == panel.chosen
        if here:
            draw.rectangle((margin // 2, top, width + 1.5 * margin, top + pitch - 1), fill=_ACCENT_PALE)
        ink, middle = _ACCENT if here else _INK, top + pitch / 2
        draw.text((margin, middle), row.name, fill=ink, font=font, anchor="lm")
        draw.text((margin + width, middle), _spelled(row.value), fill=ink, font=font, anchor="rm")
        if row.share is not None:
            _bar(draw, (margin + names + size, middle - 2, margin + names + size + bar, middle + 2), row.share)
    for number, line in enumerate(lines):
        top = margin + len(panel.rows) * pitch + size // 2 + number * pitch
        draw.text((margin, top), line, fill=_PALE, font=font)
    return _done(card)


@lru_cache(maxsize=_MOST_KEPT)
def banner_card(banner: Banner, height: int) -> Card:
    """A framed instruction in large letters, a count in huge ones, lines under it, and a bar of how much is done."""
    plain, most = letter_height(height), _BANNER * height
    rows = [(line, round(1.8 * plain), _INK) for line in _wrapped(banner.text, round(1.8 * plain), most)]
    rows += [(banner.count, 4 * plain, _ACCENT)] if banner.count else []
    rows += [(line, plain, _PALE) for text in banner.below for line in _wrapped(text, plain, most)]
    width = max(*(_length(text, _font(size)) for text, size, _ in rows), 14 * plain)
    bar = plain if banner.share is not None else 0
    card, draw = _framed(width + 2 * plain, sum(round(1.35 * size) for _, size, _ in rows) + bar + 2 * plain)
    top, middle = plain, plain + width / 2
    for text, size, ink in rows:
        draw.text((middle, top), text, fill=ink, font=_font(size), anchor="ma")
        top += round(1.35 * size)
    if banner.share is not None:
        _bar(draw, (plain, top + bar / 2, plain + width, top + bar / 2 + plain // 3), banner.share)
    return _done(card)


def _wrapped(text: str, size: int, most: float) -> list[str]:
    """The text in lines of at most so many pixels, broken between words."""
    lines = [""]
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}".strip(" ")
        if lines[-1] and _length(longer, _font(size)) > most:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


@lru_cache(maxsize=_MOST_KEPT)
def timeline_card(timeline: Timeline, width: int, height: int, background: Colour) -> Card:
    """A thin bar of that width: what has been played, and the marks."""
    size = letter_height(height) // 2
    card, draw = _blank(width, size, background)
    _bar(draw, (0, size * 0.3, width - 1, size * 0.7), timeline.share)
    for mark in timeline.marks:
        at = (width - 1) * min(max(mark, 0.0), 1.0)
        draw.rectangle((at - 1, 0, at + 1, size), fill=_MARK)
    return _done(card)


def _bar(draw: ImageDraw.ImageDraw, box: tuple[float, float, float, float], share: float) -> None:
    left, top, right, bottom = box
    end = left + min(max(share, 0.0), 1.0) * (right - left)
    draw.rectangle(box, fill=_TRACK)
    draw.rectangle((left, top, end, bottom), fill=_ACCENT)


def _halves(lines: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The groups in two columns as even as can be, an empty line before each group but the first."""
    starts = [number for number, line in enumerate(lines) if "\t" not in line][1:]
    cut = min(starts, key=lambda start: abs(2 * start - len(lines)), default=len(lines))
    return [_spaced(half) for half in (lines[:cut], lines[cut:]) if half]


def _spaced(lines: tuple[str, ...]) -> tuple[str, ...]:
    out = []
    for line in lines:
        out += ["", line] if "\t" not in line and out else [line]
    return tuple(out)


def _blank(width: int, height: int, background: Colour) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    card = Image.new("RGB", (max(width, 1), max(height, 1)), _bytes(background))
    return card, ImageDraw.Draw(card)


def _framed(width: float, height: float) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    card, draw = _blank(round(width), round(height), CARD)
    draw.rectangle((0, 0, card.width - 1, card.height - 1), outline=_bytes(_EDGE))
    return card, draw


def _done(card: Image.Image) -> Card:
    return frozen(np.array(card))


def _bytes(colour: Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * c) for c in colour)
    return red, green, blue


def _spelled(text: str) -> str:
    """With what the typeface does not have in other characters."""
    return text.replace("\N{SUPERSCRIPT TWO}", "^2")


def _length(text: str, font: ImageFont.FreeTypeFont) -> int:
    return round(font.getlength(text))


@lru_cache(maxsize=32)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font
