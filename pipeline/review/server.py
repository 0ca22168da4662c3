"""The review's local web server: its addresses, and the answer of each."""

from __future__ import annotations

import json
import math
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from pipeline.artefacts.model import Overlays
from pipeline.errors import BoresightError, InputError
from pipeline.review import documents, same_view
from pipeline.review.decisions import Point, action_of
from pipeline.review.decisions.ledger import StaleError
from pipeline.review.flat_tiles import FlatPicture, Limits, picture_of
from pipeline.review.frames import UnseenError, finder_of
from pipeline.review.guard import TWIN_POLICY
from pipeline.review.measuring import Tool, readings
from pipeline.review.model_stretches import model_of
from pipeline.review.review import Review

if TYPE_CHECKING:  # a review of one run alone need not wait for it
    from pipeline.review.compared import Compared

_Request = TypeVar("_Request", bound=BaseModel)
_Name = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*\S[^\x00-\x1f\x7f]*$")]
_Revision = Annotated[int, Field(ge=0, le=2**53)]


class PostedAction(BaseModel):
    """An action, its author, and the number of the last action that the author saw."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    action: dict[str, Any]
    who: _Name
    revision: _Revision


class PostedSignature(BaseModel):
    """A signature of the state at a revision."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: _Name
    standard: Annotated[str, Field(max_length=200)]
    remarks: Annotated[str, Field(max_length=4000)]
    revision: _Revision


class PostedPoints(BaseModel):
    """A tool at points of the wall."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    tool: Tool
    points: Annotated[tuple[Point, ...], Field(min_length=1, max_length=2000)]


def parsed(kind: type[_Request], body: bytes) -> _Request:
    """Return the request of a JSON body.

    Raises
    ------
    InputError
        When it is not one.
    """
    try:
        return kind.model_validate_json(body)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError("request", first["msg"], place=place, expected=kind.__name__.lower()) from error


_CONFLICT, _REFUSED, _MISSING = 409, 422, 404
# The page asks for these as soon as it runs: the browser asks already while it reads the page's script.
_WANTED_FIRST = ", ".join(
    f"</api/{name}>; rel=preload; as=fetch; crossorigin" for name in ("run", "state", "model")
)
Handler = Callable[[Request], Awaitable[Response]]


@dataclass(frozen=True)
class ReviewApp:
    """Answers requests on one review; everything slow runs in a thread."""

    review: Review
    page: Path
    compared: Compared | None = None
    twin: Path | None = None

    def routes(self) -> list[Route | Mount]:
        """Return all addresses."""
        return [
            Route("/", self._index),
            Mount("/assets", StaticFiles(directory=self.page / "assets")),
            Route("/twin", self._answering(self._twin)),
            Route("/api/run", self._answering(self._run)),
            Route("/api/state", self._answering(self._state)),
            Route("/api/seal", self._answering(self._seal)),
            Route("/api/actions", self._answering(self._act), methods=["POST"]),
            Route("/api/sign", self._answering(self._sign), methods=["POST"]),
            Route("/api/measure", self._answering(self._measure), methods=["POST"]),
            Route("/api/section", self._answering(self._section)),
            Route("/api/profile", self._answering(self._profile)),
            Route("/api/quality", self._answering(self._quality)),
            Route("/api/sights", self._answering(self._sights)),
            Route("/api/frames/{frame:int}/spot", self._answering(self._spot)),
            Route("/api/frames/{frame:int}/stand", self._answering(self._stand)),
            Route("/api/frames/{frame:int}/seen.png", self._answering(self._seen)),
            Route("/api/frames/{frame:int}.jpg", self._answering(self._frame)),
            Route("/api/tiles/{layer:str}", self._answering(self._layer)),
            Route(
                "/api/tiles/{layer:str}/{level:int}/{column:int}/{row:int}.png", self._answering(self._tile)
            ),
            Route("/api/papers/{name:str}", self._answering(self._paper)),
            Route("/api/comparison", self._answering(self._comparison)),
            Route("/api/comparison/{name:str}", self._answering(self._growth)),
            Route("/api/model", self._answering(self._model)),
            Route("/api/model/{stretch:int}.glb", self._answering(self._stretch)),
        ]

    def _answering(self, work: Callable[[Request, bytes], Response]) -> Handler:
        """Return a handler that runs ``work`` in a thread and returns errors as JSON with their own code."""

        async def handle(request: Request) -> Response:
            body = await request.body()
            try:
                return await run_in_threadpool(work, request, body)
            except BoresightError as error:
                return JSONResponse({"error": str(error)}, _code_of(error))

        return handle

    async def _index(self, _: Request) -> Response:
        return FileResponse(self.page / "index.html", headers={"link": _WANTED_FIRST})

    def _model(self, _: Request, __: bytes) -> Response:
        return JSONResponse(documents.model_document(model_of(self.review.files)))

    def _stretch(self, request: Request, _: bytes) -> Response:
        # The page paints its own colours: the pictures of errors need not be sent.
        part = model_of(self.review.files).stretch(request.path_params["stretch"], is_photo_alone=True)
        return Response(part, media_type="model/gltf-binary")

    def _run(self, _: Request, __: bytes) -> Response:
        return JSONResponse(documents.run_document(self.review.files) | {"twin": self.twin is not None})

    def _twin(self, _: Request, __: bytes) -> Response:
        if self.twin is None:
            raise InputError("--twin", "no twin was given", hint="boresight review RUN --twin DIR")
        page = self.twin.read_text("utf-8")
        return HTMLResponse(page, headers={"content-security-policy": TWIN_POLICY})

    def _state(self, _: Request, __: bytes) -> Response:
        return JSONResponse(documents.state_document(self.review.state(), self.review.files))

    def _seal(self, _: Request, __: bytes) -> Response:
        seal = self.review.seal(self.review.state())
        return JSONResponse(documents.seal_document(seal, self.review.files))

    def _act(self, _: Request, body: bytes) -> Response:
        posted = parsed(PostedAction, body)
        state = self.review.act(action_of(json.dumps(posted.action)), posted.who, posted.revision)
        return JSONResponse(documents.state_document(state, self.review.files))

    def _sign(self, _: Request, body: bytes) -> Response:
        wish = parsed(PostedSignature, body)
        state = self.review.sign(wish.name, wish.standard, wish.remarks, wish.revision)
        return JSONResponse(documents.state_document(state, self.review.files))

    def _measure(self, _: Request, body: bytes) -> Response:
        wish = parsed(PostedPoints, body)
        found = readings(self.review.wall(), wish.tool, wish.points)
        return JSONResponse(documents.cleaned({"readings": [vars(r) for r in found]}))

    def _section(self, request: Request, _: bytes) -> Response:
        overlays = self.review.files.artefact(Overlays)
        at = _number(request, "distance")
        return JSONResponse(documents.section_document(self.review.wall(), overlays, at))

    def _profile(self, request: Request, _: bytes) -> Response:
        at = _number(request, "distance"), _number(request, "azimuth"), _number(request, "half")
        return JSONResponse(documents.profile_document(self.review.wall(), *at))

    def _quality(self, _: Request, __: bytes) -> Response:
        from pipeline.review.quality import quality_document  # of a page that few open

        return JSONResponse(quality_document(self.review.files, self.review.wall()))

    def _sights(self, request: Request, _: bytes) -> Response:
        found = finder_of(self.review.files).sights(_number(request, "distance"), _number(request, "azimuth"))
        return JSONResponse(documents.cleaned({"sights": [vars(s) for s in found]}))

    def _spot(self, request: Request, _: bytes) -> Response:
        uv = _number(request, "u"), _number(request, "v")
        found = finder_of(self.review.files).spot(request.path_params["frame"], uv)
        return JSONResponse({"point": found})

    def _stand(self, request: Request, _: bytes) -> Response:
        return JSONResponse(documents.cleaned(vars(self._stand_of(request))))

    def _seen(self, request: Request, _: bytes) -> Response:
        fov, width, height = (_number(request, name) for name in ("fov", "width", "height"))
        finder = finder_of(self.review.files)
        png = same_view.seen_png(finder, self._stand_of(request), math.radians(fov), int(width), int(height))
        return Response(png, media_type="image/png")

    def _stand_of(self, request: Request) -> same_view.Stand:
        at = _number(request, "distance"), _number(request, "azimuth")
        return same_view.stand_in(self.review.files, request.path_params["frame"], *at)

    def _frame(self, request: Request, _: bytes) -> Response:
        jpeg = finder_of(self.review.files).picture(request.path_params["frame"])
        return Response(jpeg, media_type="image/jpeg")

    def _layer(self, request: Request, _: bytes) -> Response:
        picture = self._picture(request)
        return JSONResponse(documents.layer_document(picture))

    def _tile(self, request: Request, _: bytes) -> Response:
        at: dict[str, Any] = request.path_params
        picture = self._picture(request)
        return Response(picture.tile(at["level"], at["column"], at["row"]), media_type="image/png")

    def _picture(self, request: Request) -> FlatPicture:
        layer, limits = request.path_params["layer"], _limits(request)
        if self.compared is None:
            return picture_of(self.review.files, layer, limits)
        return self.compared.picture(layer, limits)

    def _comparison(self, _: Request, __: bytes) -> Response:
        """Answer null where the review is of one run alone."""
        return JSONResponse(self.compared.document() if self.compared else None)

    def _growth(self, request: Request, _: bytes) -> Response:
        if self.compared is None:
            raise InputError(
                "compare", "no earlier run was given", hint="boresight review RUN --compare EARLIER"
            )
        name = request.path_params["name"]
        media_type, content = self.compared.table(name)
        headers = {"content-disposition": f'attachment; filename="{name}"'}
        return Response(content, media_type=media_type, headers=headers)

    def _paper(self, request: Request, _: bytes) -> Response:
        # It draws with matplotlib, for which the first view need not wait.
        from pipeline.review.papers import paper_of

        paper = paper_of(request.path_params["name"], self.review, self.review.state())
        disposition = f'{"inline" if paper.shown else "attachment"}; filename="{paper.name}"'
        return Response(
            paper.content, media_type=paper.media_type, headers={"content-disposition": disposition}
        )


def application(
    review: Review, page: Path, compared: Compared | None = None, twin: Path | None = None
) -> Starlette:
    """Return the server's application, unguarded: see `pipeline.review.guard`."""
    return Starlette(routes=ReviewApp(review, page, compared, twin).routes())


def _number(request: Request, name: str) -> float:
    text = request.query_params.get(name, "")
    try:
        value = float(text)
    except ValueError as error:
        raise InputError("request", f"{name} is {text[:40]!r}", expected="a number") from error
    if not abs(value) < 1e9:  # mm: a thousand kilometres
        raise InputError("request", f"{name} is {text[:40]!r}", expected="a number between -1e9 and 1e9")
    return value


def _limits(request: Request) -> Limits | None:
    """Return between which values a layer is coloured, None where the request leaves it to the run."""
    if not {"low", "high"} & set(request.query_params):
        return None
    low, high = _number(request, "low"), _number(request, "high")
    if not low < high:
        raise InputError("request", f"low {low:g} is not below high {high:g}", expected="low < high")
    return Limits(low, high)


def _code_of(error: BoresightError) -> int:
    if isinstance(error, StaleError):
        return _CONFLICT
    return _MISSING if isinstance(error, UnseenError) else _REFUSED
