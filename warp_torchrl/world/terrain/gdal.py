"""GDAL settings for untrusted files: no network, no sidecar files, one-line errors."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

NO_RASTERIO = 'must be read with rasterio, which is missing: pip install "warp_torchrl[gis]"'
_ALONE = {
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",  # a mask beside a file may be of any driver, VRT too
    "GDAL_PAM_ENABLED": "NO",
    "CPL_VSIL_CURL_ALLOWED_EXTENSIONS": "{none}",
    "GDAL_HTTP_MAX_RETRY": "0",
    "GTIFF_REPORT_COMPD_CS": "NO",
}
"""Options of GDAL: no network, no sidecars, and the horizontal part of a compound CRS."""


@contextmanager
def reading(rule: str, **options: str) -> Iterator[Any]:
    """Yield rasterio while GDAL and PROJ read only named files.

    Args:
        rule: How the line begins that an error of theirs becomes: what is read, ``must``, and the rule.
        options: Further options of GDAL.

    Raises:
        ValueError: If rasterio is missing, or GDAL, PROJ or the file system raise.
    """
    try:
        import rasterio
    except ImportError:
        raise ValueError(f"{rule.partition(' must ')[0]} {NO_RASTERIO}") from None
    from rasterio._err import CPLE_BaseError
    from rasterio.errors import CRSError, RasterioError

    os.environ["PROJ_NETWORK"] = "OFF"  # GDAL has no option for it
    try:
        with rasterio.Env(**{**_ALONE, **options}):
            yield rasterio
    except (RasterioError, CRSError, CPLE_BaseError, OSError) as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise ValueError(f"{rule}: {reason}") from None
