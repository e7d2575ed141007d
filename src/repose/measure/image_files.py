"""Read picture files, which are checked before they are decoded.

OpenCV and Pillow are imported where a file is read: a process that only measures
simulated piles needs neither of them for it.
"""

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from repose.common.errors import InputError

if TYPE_CHECKING:
    from PIL.Image import Image as PillowImage

MIN_SIDE_PX = 20  # smallest width and height of a picture
MAX_PIXELS = 200_000_000  # largest number of pixels of a picture
PICTURE_FORMATS = "PNG, JPEG, TIFF, BMP"
# A phone's HEIC file has four bytes of another meaning, these four, and one of the
# brands.
HEIC_MARK = b"ftyp"
HEIC_BRANDS = (
    b"heic",
    b"heix",
    b"hevc",
    b"hevx",
    b"heim",
    b"heis",
    b"mif1",
    b"msf1",
)
# The brightest tone of a picture is estimated by this quantile, because single faulty
# pixels are brighter. Every `PEAK_STEP`-th row and column is enough for it.
PEAK_QUANTILE = 0.999
PEAK_STEP = 8


def read_image(path: str | PathLike) -> np.ndarray:
    """Read a picture file as BGR, with 8 bits for each colour.

    The picture is turned upright if an EXIF entry says how the camera was held. A
    camera may store colours of 10 or 12 bits in 16 bits. Of such a picture, the upper
    eight of the bits in use are kept.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    ndarray
        The picture (H, W, 3), uint8, BGR.

    Raises
    ------
    InputError
        If the file is missing, is not a picture, or is a picture that cannot be
        measured, such as one that is too small.
    """
    import cv2

    path = Path(path)
    if not path.is_file():
        problem = "a folder" if path.is_dir() else "no such file"
        raise InputError(
            path,
            key="picture",
            value=problem,
            allowed=f"an existing picture file ({PICTURE_FORMATS})",
        )

    # Check the header first, because decoding a huge picture could take all the memory.
    _reject_heic(path)
    has_header = _check_header(path)
    content = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    image: np.ndarray | None
    try:
        # This also turns the picture upright by its EXIF entry.
        image = cv2.imdecode(content, cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH)
    except cv2.error:
        # The file is empty, or has more pixels than OpenCV accepts.
        image = None
    if image is None:
        raise InputError(
            path,
            key="picture",
            value=_describe_problem(content.size, has_header),
            allowed=f"a complete picture file ({PICTURE_FORMATS})",
        )

    if image.dtype == np.uint8:
        return image
    if image.dtype == np.uint16:
        return _keep_upper_bits(image)
    raise InputError(
        path,
        key="picture",
        value=f"a picture of {image.dtype} numbers",
        allowed="a picture with 8 to 16 bits for each colour; save it in this form",
    )


def _describe_problem(n_bytes: int, has_header: bool) -> str:
    """Describe why a file of this many bytes cannot be decoded as a picture.

    `has_header` tells whether the file begins like a picture.
    """
    if n_bytes == 0:
        return "an empty file"
    return "cut off or damaged" if has_header else "not a picture"


def _keep_upper_bits(image: np.ndarray) -> np.ndarray:
    """Convert a picture from 16 to 8 bits for each colour.

    The upper eight of the bits that the picture uses are kept.
    """
    # The bits in use are those of the brightest tone.
    peak = int(np.quantile(image[::PEAK_STEP, ::PEAK_STEP], PEAK_QUANTILE))
    shift = max(peak.bit_length() - 8, 0)
    return np.minimum(np.right_shift(image, shift), 255).astype(np.uint8)


def _reject_heic(path: Path) -> None:
    """Raise InputError for a HEIC file, which is known by its first bytes."""
    with path.open("rb") as file:
        start = file.read(12)
    if start[4:8] == HEIC_MARK and start[8:12] in HEIC_BRANDS:
        raise InputError(
            path,
            key="picture",
            value="HEIC",
            allowed="PNG or JPEG; a phone exports it (`heif-convert a.heic a.jpg`)",
        )


def _check_header(path: Path) -> bool:
    """Check the size of a picture and its number of pages, before it is decoded.

    A file whose header Pillow cannot read is accepted here, because OpenCV decides
    later whether it is a picture. Pillow's limit of pixels, a global variable, is
    changed for a moment, so do not call this in several threads at once.

    Returns
    -------
    bool
        Whether Pillow could read the header.

    Raises
    ------
    InputError
        If the picture has several pages, or is too small or too large.
    """
    from PIL import Image, UnidentifiedImageError

    # The pictures of some phones are larger than Pillow's own limit, so remove it here.
    pillow_limit = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = None
    try:
        with Image.open(path) as picture:
            width, height = picture.size
            n_pages = _count_pages(picture)
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError):
        return False
    finally:
        Image.MAX_IMAGE_PIXELS = pillow_limit
    if n_pages != 1:
        raise InputError(
            path,
            key="pages",
            value=n_pages,
            allowed="1; save each page as a separate file",
        )
    if min(width, height) < MIN_SIDE_PX or width * height > MAX_PIXELS:
        size = f"{width} x {height} pixels"
        raise InputError(
            path,
            key="size",
            value=size,
            allowed=(
                f"at least {MIN_SIDE_PX} pixels in each direction, and at most "
                f"{MAX_PIXELS / 1e6:g} million in total"
            ),
        )
    return True


def _count_pages(picture: "PillowImage") -> int:
    """Count the pages of a picture; a phone's JPEG with a second view counts as one."""
    # MPO is a JPEG file with several views of one scene.
    if picture.format == "MPO":
        return 1
    return getattr(picture, "n_frames", 1)
