"""Embed pictures in the page, which then needs no further file."""

import base64
import io
import os
from collections.abc import Mapping
from typing import Any, NamedTuple

from PIL import Image, UnidentifiedImageError

from repose.common.errors import InputError

LONGEST_SIDE_PX = 1600
CSS_DPI = 96
# At this scale, the smallest text of a figure, of 6 points, is 9 pixels high.
MIN_SCALE = 1.1
PALETTE_COLOURS = 128
JPEG_QUALITY = 85

PictureSource = str | os.PathLike[str] | io.BytesIO


class EmbeddedPicture(NamedTuple):
    """A picture as part of the page, with sizes in pixels."""

    caption: str
    data_url: str
    width: int
    height: int
    min_width: int  # smallest width at which the page shows the picture


def embed_picture(source: PictureSource, caption: str) -> EmbeddedPicture:
    """Embed a picture in the page.

    A picture with a side of more than `LONGEST_SIDE_PX` is scaled down. A PNG file is
    taken for a drawing, and any other file for a photograph. If a PNG file states a
    resolution, it probably contains text. The page shows it at least at `MIN_SCALE`
    times its size on paper, so that the text stays readable.

    Parameters
    ----------
    source : path or file
        The picture, as PNG or JPEG.
    caption : str
        Text below the picture.

    Returns
    -------
    EmbeddedPicture
        The picture with its caption.

    Raises
    ------
    InputError
        If the file cannot be read as a picture.
    """
    try:
        with Image.open(source) as opened:
            image = opened.convert("RGB")
            is_drawing = opened.format == "PNG"
            dpi = opened.info.get("dpi", (0,))[0]
    except (UnidentifiedImageError, FileNotFoundError, IsADirectoryError) as error:
        raise InputError(
            source, key="picture", value=str(error), allowed="a PNG or JPEG file"
        ) from error
    # The width on paper in inches is the number of pixels over the dots per inch. Use
    # the original number of pixels, so do this before the picture is scaled down.
    min_width = 0
    if is_drawing and dpi:
        min_width = round(MIN_SCALE * CSS_DPI * image.width / dpi)
    image.thumbnail((LONGEST_SIDE_PX, LONGEST_SIDE_PX))
    return EmbeddedPicture(
        caption=caption,
        data_url=_encode_data_url(image, is_drawing),
        width=image.width,
        height=image.height,
        min_width=min_width,
    )


def embed_captioned_pictures(
    files: Mapping[str, Any], captions: Mapping[str, str]
) -> list[EmbeddedPicture]:
    """Embed the pictures that have a caption, in the order of the captions."""
    return [
        embed_picture(files[name], caption)
        for name, caption in captions.items()
        if name in files
    ]


def _encode_data_url(image: Image.Image, is_drawing: bool) -> str:
    """Encode a picture as a data URL: a drawing as PNG, any other picture as JPEG.

    To save bytes, a drawing is reduced to a palette of few colours.

    Parameters
    ----------
    image : Image
        The picture.
    is_drawing : bool
        Whether it is a drawing.

    Returns
    -------
    str
        The data URL.
    """
    content = io.BytesIO()
    if is_drawing:
        kind = "png"
        image.quantize(PALETTE_COLOURS).save(content, "PNG", optimize=True)
    else:
        kind = "jpeg"
        image.save(content, "JPEG", quality=JPEG_QUALITY)
    coded = base64.b64encode(content.getvalue()).decode()
    return f"data:image/{kind};base64,{coded}"
