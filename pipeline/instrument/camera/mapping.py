"""The ``camera:`` section of probe.yaml: a mapping with ``model`` and that model's own parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.fields import Fields, nearest
from pipeline.instrument.camera.kannala_brandt import KannalaBrandt


def camera_from_mapping(mapping: Mapping[str, object], file: Path) -> Camera:
    """Return the camera that the ``camera:`` section of ``file`` describes.

    Raises
    ------
    InputError
        Naming the key at fault: missing, unknown, of another type or length, not finite, or not positive
        where it must be; or an unknown model, with the nearest known one.
    """
    fields = Fields(mapping, file, "camera")
    name = fields.text("model")
    if name not in MODELS:
        raise fields.error(
            "model", f"unknown camera model {name!r}{nearest(name, MODELS)}", ", ".join(MODELS)
        )
    camera = MODELS[name](fields)
    fields.refuse_others()
    return camera


def camera_to_mapping(camera: Camera) -> dict[str, object]:
    """Return the ``camera:`` section that `camera_from_mapping` reads back to the same camera."""
    shared: dict[str, object] = {"model": camera.model, "image_size": list(camera.image_size)}
    match camera:
        case KannalaBrandt():
            return shared | _lists(
                focal_px=camera.focal_px, centre_px=camera.centre, distortion=camera.distortion
            )
        case _:
            raise TypeError(f"no mapping is known for {type(camera).__name__}")


def _lists(**values: tuple[float, ...]) -> dict[str, object]:
    return {key: [float(v) for v in value] for key, value in values.items()}


def _kannala_brandt(fields: Fields) -> Camera:
    k1, k2, k3, k4 = fields.numbers("distortion", 4)
    return KannalaBrandt(
        fields.image_size(),
        fields.pair("focal_px", positive=True),
        fields.pair("centre_px"),
        (k1, k2, k3, k4),
    )


MODELS: Mapping[str, Callable[[Fields], Camera]] = {
    "kannala_brandt": _kannala_brandt,
}
