# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the tables of the documentation from the tables of the code.

A table stands between the lines `<!-- table: NAME -->` and `<!-- end -->`, sections between `<!-- text: NAME -->` and
`<!-- end -->`; all else in a page is left alone.
`make_docs.py` rewrites them, `make_docs.py --check` fails when one is stale.
"""

import ast
import dataclasses
import enum
import inspect
import itertools
import json
import math
import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from typer.testing import CliRunner

from ap_core.param import ParamFlag, ParamGroup, ParamInfo, ParamType
from ap_visualodom.ap_visualodom import BACKENDS, make_params
from ekf_stub.inputs.ingest_rules import RULES as FILTER_RULES
from mav_handlers.handlers import HANDLERS, VISION_MESSAGES
from mav_handlers.handlers.commands import COMMANDS as MAV_COMMANDS
from mav_handlers.handlers.commands import MavCmd
from mav_handlers.links import LINKS
from mav_handlers.senders import SENDERS, STREAM_GROUPS, inertial, nothing_to_report, parked
from mav_handlers.verdicts import ALL_VERDICTS
from mav_handlers.wire.codec import full_length, message_id
from mav_handlers.wire.messages import MESSAGES
from viso.cli import COMMANDS as CLI_COMMANDS
from viso.cli import make_app
from viso.companion.engine import protocol as engine_protocol
from viso.companion.sources.kinds import SOURCES
from viso.companion.vio.config import VioConfig
from viso.compare.recordings import RECORDING_KINDS
from viso.compare.tolerances import TEXT_EXCEPTIONS, TOLERANCES
from viso.doctor.checks import CHECKS as DOCTOR_CHECKS
from viso.doctor.checks import FAMILIES as DOCTOR_FAMILIES
from viso.doctor.evidence.own_filter import Witness
from viso.explain.texts import GROUPS
from viso.faults.fault import parameters_of
from viso.faults.kinds import FAULTS
from viso.firmware.changes import DIFFERENCES
from viso.firmware.releases import PROFILES, Firmware
from viso.geometry.frame_change import PRESETS as AXES
from viso.parameters.left_out import LEFT_OUT
from viso.parameters.releases import ALL_RENAMES
from viso.parameters.table import make_groups
from viso.recording.outputs import FILES as RECORDING_FILES
from viso.recording.scenario import MOTIONS, SCENARIOS, STEPS, Scenario, Stream, read_scenario
from viso.replay.figures import OBJECTIVES
from viso.streams.messages import FORMS
from viso.streams.readers import FORMATS as TRAJECTORY_FORMATS
from viso.streams.stream_kinds import STREAM_KINDS
from viso.terminal.settings import PRESETS, known_parameters, preset_title
from viso.vehicle.outcomes import basis, is_final, outcome_kind, why
from viso.web.faults import SWITCHES
from viso.web.requests import ACTIONS

DOCS: Final = Path(__file__).resolve().parent.parent / "docs"
PACKAGES: Final = ("viso", "mav_handlers", "ap_visualodom", "ekf_stub", "ap_core")
_BLOCK: Final = re.compile(r"(<!-- (table|text): (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_TYPE_NAMES: Final = {
    ParamType.INT8: "int8",
    ParamType.INT16: "int16",
    ParamType.INT32: "int32",
    ParamType.FLOAT: "float",
    ParamType.VECTOR3F: "float, three: _X, _Y, _Z",
}

Rows = Iterable[tuple[str, ...]]


def first_line(thing: object) -> str:
    """Return the first line of a docstring."""
    return (getattr(thing, "__doc__", None) or "").strip().splitlines()[0]


def _messages() -> Iterator[tuple[str, ...]]:
    for cls in HANDLERS:
        name = cls.__name__
        kind = "external navigation" if cls in VISION_MESSAGES else ""
        yield f"`{name}`", str(message_id(name)), str(full_length(cls)), kind, first_line(cls)


def _ignored() -> Iterator[tuple[str, ...]]:
    for name, cls in sorted(MESSAGES.items()):
        if cls not in HANDLERS:
            yield f"`{name}`", first_line(cls)


def _sent() -> Iterator[tuple[str, ...]]:
    groups = {name: f"`MAVn{suffix}`" for suffix, names in STREAM_GROUPS.values() for name in names}
    for name, builder in SENDERS.items():
        if builder is not nothing_to_report:
            when = "1 Hz" if name == "HEARTBEAT" else groups.get(name, "on request")
            is_placeholder = builder.__module__ in (inertial.__name__, parked.__name__)
            yield f"`{name}`", when, "placeholder" if is_placeholder else "", first_line(builder)


def _silent() -> Iterator[tuple[str, ...]]:
    for name, builder in SENDERS.items():
        if builder is nothing_to_report:
            yield f"`{name}`", str(message_id(name))


def _commands() -> Iterator[tuple[str, ...]]:
    for number, handler in MAV_COMMANDS.items():
        yield f"`{MavCmd(number).name}`", str(int(number)), first_line(handler)


def _verdicts() -> Iterator[tuple[str, ...]]:
    for verdict in ALL_VERDICTS:
        yield f"`{verdict.rule.code}`", verdict.kind.value, verdict.rule.text, verdict.rule.source


def _filter_verdicts() -> Iterator[tuple[str, ...]]:
    for rule in filter(is_final, FILTER_RULES):
        yield f"`{rule.code}`", outcome_kind(rule).value, why(rule), basis(rule), rule.source


def _texts(group: str) -> Iterator[tuple[str, ...]]:
    for text in GROUPS[group]:
        codes = ", ".join(f"[{code}](doctor-codes.md#{code.lower()})" for code in text.codes)
        yield f"`{text.shown}`", text.cause, text.check, text.fix, codes


def _backends() -> Iterator[tuple[str, ...]]:
    for kind, cls in BACKENDS.items():
        yield str(int(kind)), kind.name, f"`{getattr(cls, '__name__', '')}`", first_line(cls)


def _recording_kinds() -> Iterator[tuple[str, ...]]:
    for name, kind in RECORDING_KINDS.items():
        yield name, ", ".join(f"`{ending}`" for ending in kind.endings), kind.content


def _tolerances() -> Iterator[tuple[str, ...]]:
    for row in TOLERANCES:
        fields = ", ".join(f"`{field}`" for field in row.fields)
        backends = ", ".join(map(str, row.backends)) or "all"
        yield row.kind, fields, backends, row.limits(), row.reason


def _text_exceptions() -> Iterator[tuple[str, ...]]:
    for one in TEXT_EXCEPTIONS:
        texts = ("<br>".join(f"`{text}`" for text in side) for side in (one.recorded, one.ours))
        yield f"`{one.name}`, {one.messages} messages", *texts, one.reason


def _left_out() -> Iterator[tuple[str, ...]]:
    for row in LEFT_OUT:
        asked_by = (f"`{name}` {f'{value:g}' if value else 'above 0'}" for name, value in row.asked_by.items())
        yield row.what, ", ".join(asked_by), row.line


def _links() -> Iterator[tuple[str, ...]]:
    for factory in LINKS.values():
        yield f"`{factory.form}`", factory.summary


def _cli() -> Iterator[tuple[str, ...]]:
    for name, line in CLI_COMMANDS.items():
        yield f"[`viso {name}`](#viso-{name})", line


def _command_sections() -> Iterator[str]:
    app = make_app()
    for name in CLI_COMMANDS:
        said = CliRunner().invoke(app, [name, "--help"], prog_name="viso", terminal_width=80)
        yield f"## viso {name}\n"
        yield f"```text\n{said.output.strip()}\n```\n"


def _api() -> Iterator[str]:
    """Yield a section for each package that lists names; mkdocstrings fills it on the site, each name once."""
    shown = set[tuple[str, int]]()
    for package in _public_packages():
        module = import_module(package)
        names = {name: (name, id(getattr(module, name))) for name in module.__all__}
        own = [name for name, key in names.items() if key not in shown]
        shown.update(names.values())
        yield f"## {package}\n"
        yield f"::: {package}\n    options:\n      members: [{', '.join(own)}]\n"
        if above := ", ".join(f"`{name}`" for name in names if name not in own):
            yield f"Explained above: {above}.\n"


def _public_packages() -> Iterator[str]:
    for root in PACKAGES:
        for file in sorted((DOCS.parent / root).rglob("__init__.py")):
            if "__all__" in file.read_text(encoding="utf-8"):
                yield ".".join(file.parent.relative_to(DOCS.parent).parts)


def _default(row: ParamInfo) -> str:
    return ", ".join(f"{value:g}" for value in row.default) if isinstance(row.default, tuple) else f"{row.default:g}"


def _remarks(row: ParamInfo) -> str:
    values = ", ".join(f"{number} {text}" for number, text in row.values.items())
    limits = f"{row.range[0]:g} to {row.range[1]:g}" if row.range else ""
    notes = ["reboot needed"] if row.reboot_required else []
    if ParamFlag.HIDDEN in row.flags:
        notes.append("not listed")
    return "; ".join(part for part in (values, limits, *notes) if part)


def _group_rows(group: ParamGroup) -> Iterator[tuple[str, ...]]:
    for row in group.var_info:
        name, kind = f"`{group.prefix}{row.name}`", _TYPE_NAMES[row.type]
        yield name, kind, _default(row), row.unit, _remarks(row), row.description


def _parameters() -> Iterator[tuple[str, ...]]:
    for group in make_groups(1, make_params()):
        yield from _group_rows(group)


def _axes() -> Iterator[tuple[str, ...]]:
    for name, preset in AXES.items():
        yield f"`{name}`", f"`{preset.world}/{preset.body}`", preset.summary


def _trajectory_formats() -> Iterator[tuple[str, ...]]:
    for name, row in TRAJECTORY_FORMATS.items():
        yield f"`{name}`", row.content, row.writers


def _forms() -> Iterator[tuple[str, ...]]:
    for name, form in FORMS.items():
        yield f"`{name}`", form.summary


def _stream_kinds() -> Iterator[tuple[str, ...]]:
    for name, row in STREAM_KINDS.items():
        yield name, ", ".join(f"`{ending}`" for ending in row.endings), row.content, row.params


def _firmware() -> Iterator[tuple[str, ...]]:
    def row(what: str, cell: Callable[[Firmware], str], source: str = "") -> tuple[str, ...]:
        return what, *map(cell, PROFILES.values()), source

    yield row("since", lambda one: one.date)
    yield row("version text", lambda one: f"`{one.banner}`")
    for topic, differences in itertools.groupby(DIFFERENCES, key=lambda one: one.topic):
        yield (f"**{topic}**", *("" for _ in PROFILES), "")
        for one in differences:
            how = "" if one.is_recorded else " (read)"
            yield row(
                one.what, one.of, f"{'; '.join(f'`{change.revision}`, {change.date}' for change in one.upstream)}{how}"
            )


def _renames() -> Iterator[tuple[str, ...]]:
    for old, rename in ALL_RENAMES.items():
        if not old.startswith("SR") or old.startswith("SR0_"):
            since = next(one.name for one in PROFILES.values() if known_parameters(1, one).find(rename.new) is not None)
            yield f"`{old}`", f"`{rename.new}`", since, first_line(rename.convert).rstrip(".").removeprefix("Return ")


def _presets() -> Iterator[tuple[str, ...]]:
    for name, path in PRESETS.items():
        yield f"`{name}`", preset_title(path)


def _preset_values(path: Path) -> Iterator[tuple[str, ...]]:
    for line in path.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            value, _, why_so = line.partition("#")
            yield f"`{' '.join(value.split())}`", why_so.strip() or "likewise"


def _sources() -> Iterator[tuple[str, ...]]:
    for name, row in SOURCES.items():
        yield f"`{name}`", row.summary, row.axes


def _documented(section: Any) -> dict[str, str]:
    """Return what the docstring of a dataclass says about each of its fields."""
    text = inspect.getdoc(section) or ""
    entries = re.findall(r"^    (\w[\w, ]*): ((?:.|\n        )+)", text.partition("Attributes:")[2], re.MULTILINE)
    return {name: " ".join(what.split()) for names, what in entries for name in names.split(", ")}


def _fault_kinds() -> Iterator[tuple[str, ...]]:
    for name, cls in FAULTS.items():
        own = ", ".join(f"`{field.name}`" for field in parameters_of(cls))
        yield f"`{name}`", first_line(cls), own, f"`{cls.sitl}`" if cls.sitl else "", "goes on" if cls.lasts else ""


def _as_yaml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_as_yaml, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _fault_parameters() -> Iterator[tuple[str, ...]]:
    for kind, cls in FAULTS.items():
        said = _documented(cls)
        for field in parameters_of(cls):
            low, high = field.metadata.get("range", (-math.inf, math.inf))
            limits = "" if math.isinf(high) else f"{low:g} to {high:g}"
            if isinstance(field.default, enum.StrEnum):
                limits = ", ".join(f"`{one}`" for one in type(field.default))
            yield f"`{kind}`", f"`{field.name}`", f"`{_as_yaml(field.default)}`", limits, said[field.name].rstrip(".")


_WITNESSES: Final = {
    Witness.LOG: "the vehicle: its log or telemetry",
    Witness.STREAM: "the stream",
    Witness.MODEL: "a model",
}


def _doctor_codes() -> Iterator[tuple[str, ...]]:
    for check in DOCTOR_CHECKS:
        link = f"[{check.code}](#{check.code.lower()})"
        yield check.title, link, check.severity.value, _WITNESSES[check.witness]


def _doctor_sections() -> Iterator[str]:
    family = ""
    for check in DOCTOR_CHECKS:
        if check.family != family:
            family = check.family
            yield f"## {family}: {DOCTOR_FAMILIES[family]}\n"
        yield f"### {check.code}\n"
        yield f"**{check.title}** ({check.severity.value}; witness: {_WITNESSES[check.witness]}).\n"
        yield f"What the autopilot does: {check.firmware} Decided in {check.source}.\n"
        yield f"What to do: {check.fix}\n"


def _engine_protocol() -> Iterator[str]:
    for sender, kinds in (("viso", engine_protocol.FROM_VISO), ("the engine", engine_protocol.FROM_ENGINE)):
        for number, kind in kinds.items():
            name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__).upper()
            yield f"### {name}, {number}, from {sender}\n"
            yield f"{first_line(kind)}\n"
            rows = [(f"`{one.name}`", f"`{one.code}`", one.text) for one in engine_protocol.fields_of(kind)]
            yield _in_markdown([("field", "code", "what it is"), ("---", "---", "---"), *rows])
    for choices in (engine_protocol.Capability, engine_protocol.Status, engine_protocol.CovarianceKind):
        yield f"### {choices.__name__}\n"
        texts = _choice_texts(choices)
        rows = [(f"`{one.name}`", str(one.value), texts[str(one.name)]) for one in choices]
        yield _in_markdown([("name", "value", "what it means"), ("---", "---", "---"), *rows])


def _choice_texts(choices: type[enum.IntEnum | enum.IntFlag]) -> dict[str, str]:
    """Return what stands below each member of an enumeration."""
    (body,) = ast.parse(inspect.getsource(choices)).body
    assert isinstance(body, ast.ClassDef)
    texts = {}
    for line, below in itertools.pairwise([*body.body, ast.Pass()]):
        if isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Name):
            texts[line.targets[0].id] = ast.literal_eval(below.value) if isinstance(below, ast.Expr) else ""
    return texts


def _as_toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{}"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _config_rows(section: Any, path: str) -> Iterator[tuple[str, ...]]:
    said = _documented(section)
    for field in dataclasses.fields(section):
        value = getattr(section, field.name)
        if dataclasses.is_dataclass(value):
            yield from _config_rows(value, f"{path}.{field.name}")
            continue
        low, high = field.metadata.get("range", (None, None))
        choices = ", ".join(f"`{one}`" for one in type(value)) if isinstance(value, enum.StrEnum) else ""
        limits = choices if low is None else f"{low:g} to {high:g}"
        if isinstance(value, dict):
            limits = "a table of numbers, texts, true and false"
        yield f"`{path}.{field.name}`", f"`{_as_toml(value)}`", limits, said[field.name].rstrip(".")


def _vio_config() -> Iterator[tuple[str, ...]]:
    yield from _config_rows(VioConfig(), "vio")


def _objectives() -> Iterator[tuple[str, ...]]:
    for name, objective in OBJECTIVES.items():
        yield f"`{name}`", objective.unit, objective.what


def _scenarios() -> Iterator[tuple[str, ...]]:
    for name in SCENARIOS:
        yield f"`{name}`", read_scenario(name).about


def _scenario_fields() -> Iterator[tuple[str, ...]]:
    for name, what in _documented(Scenario).items():
        yield f"`{name}`", what.rstrip(".")


def _scenario_steps() -> Iterator[tuple[str, ...]]:
    for name, (_, takes) in STEPS.items():
        yield f"`{name}`", takes


def _scenario_streams() -> Iterator[tuple[str, ...]]:
    said = _documented(Stream)
    for field in dataclasses.fields(Stream)[1:]:
        values = f": {', '.join(f'`{one}`' for one in MOTIONS)}" if field.name == "motion" else ""
        yield f"`{field.name}`", f"`{_as_yaml(field.default)}`", said[field.name].rstrip(".") + values


def _recording_files() -> Iterator[tuple[str, ...]]:
    for ending, what in RECORDING_FILES.items():
        yield f"`NAME{ending}`", what


def _web_actions() -> Iterator[tuple[str, ...]]:
    for action in ACTIONS:
        yield action.label, f"`{action.key}`" if action.key else "", action.about


def _web_faults() -> Iterator[tuple[str, ...]]:
    for switch in SWITCHES:
        yield switch.label, switch.about


_CLIENTS: Final = {
    "MAVProxy": ("mavproxy", ("test_mavproxy",)),
    "MAVSDK 4": ("mavsdk", ("test_mavsdk", "test_flying.test_mavsdk")),
    "MAVSDK 3": ("mavsdk-grpc", ("test_mavsdk3",)),
    "dronekit2": ("dronekit2", ("test_dronekit",)),
    "node-mavlink": ("node-mavlink", ("test_node_mavlink",)),
    "pymavlink": ("pymavlink", ("test_pymavlink_serve", "test_pymavlink_tools", "test_flying.test_example")),
    "two by TCP, three by UDP, one by a serial port, at once": ("", ("test_several_clients",)),
}
"""Each client's package, and its tests in tests/interop: a file, and how their names begin in it."""


def _clients() -> Iterator[tuple[str, ...]]:
    root = DOCS.parent
    node = json.loads((root / "tools/interop_node/package-lock.json").read_text(encoding="utf-8"))["packages"]
    lock = (root / "requirements/interop.lock").read_text(encoding="utf-8")
    versions = dict(re.findall(r"^([\w-]+)==([^\s;]+)", lock, re.MULTILINE))
    versions |= {name.removeprefix("node_modules/"): one.get("version", "") for name, one in node.items() if name}
    for client, (package, places) in _CLIENTS.items():
        does = []
        for file, _, start in (place.partition(".") for place in places):
            text = (root / f"tests/interop/{file}.py").read_text(encoding="utf-8")
            names = re.findall(r"^(?:async )?def test_(\w+)", text, re.MULTILINE)
            does += [name.replace("_", " ") for name in names if f"test_{name}".startswith(start)]
        yield client, versions.get(package, ""), "; ".join(does)


def _layers() -> dict[str, list[list[str]]]:
    """Return the layers of each package, and of "" those of the packages, by the contracts of import-linter."""
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    return {
        container: [layer.split(" | ") for layer in contract["layers"]]
        for contract in project["tool"]["importlinter"]["contracts"]
        for container in contract.get("containers", [""])
        if contract["type"] == "layers"
    }


def _layer_section() -> Iterator[str]:
    plans = {name or "packages": layers for name, layers in _layers().items()}
    width = max(map(len, plans))
    lines = [
        f"{'' if row else name:{width}}  {' | '.join(layer)}"
        for name, layers in plans.items()
        for row, layer in enumerate(layers)
    ]
    yield "```text\n" + "\n".join(lines) + "\n```\n"


def _rooms(above: str = "") -> Iterator[tuple[str, ...]]:
    for name in itertools.chain(*_layers().get(above.strip("/").replace("/", "."), [])):
        place = DOCS.parent / above / name
        file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
        yield f"`{above}{file.name if file.parent != place else name + '/'}`", text.partition("\n")[0]
        yield from _rooms(f"{above}{name}/")


TABLES: Final[Mapping[str, tuple[tuple[str, ...], Callable[[], Rows]]]] = {
    "messages": (("message", "id", "bytes", "", "content"), _messages),
    "ignored": (("message", "content"), _ignored),
    "sent": (("message", "rate", "", "content"), _sent),
    "silent": (("message", "id"), _silent),
    "commands": (("command", "number", "what it does"), _commands),
    "verdicts": (("code", "outcome", "why", "where the firmware decides"), _verdicts),
    "filter_verdicts": (("code", "outcome", "why", "basis", "where the firmware decides"), _filter_verdicts),
    **{
        f"texts_{group.split()[-1]}": (
            ("text", "what it means", "what to check", "what to do", "more"),
            partial(_texts, group),
        )
        for group in GROUPS
    },
    "backends": (("VISO_TYPE", "name", "class", "what it does"), _backends),
    "links": (("connection string", "what it is"), _links),
    "clients": (("client", "version", "what the tests do"), _clients),
    "cli": (("command", "what it does"), _cli),
    "presets": (("preset", "what it is for"), _presets),
    **{
        f"preset_{name.replace('-', '_')}": (("parameter", "why"), partial(_preset_values, path))
        for name, path in PRESETS.items()
    },
    "firmware": (("", *(f"`{name}`" for name in PROFILES), "changed by"), _firmware),
    "renames": (("before", "name", "since", "value"), _renames),
    "axes": (("--axes", "world/body", "whose they are"), _axes),
    "trajectory_formats": (("--format", "a record", "who writes it"), _trajectory_formats),
    "forms": (("--as", "what is sent"), _forms),
    "stream_kinds": (("kind", "endings", "what it holds", "parameters from"), _stream_kinds),
    "sources": (("--source", "what it is", "axes of its IMU"), _sources),
    "faults": (("kind", "what happens", "parameters", "SITL", "`at_s`"), _fault_kinds),
    "fault_parameters": (("kind", "parameter", "default", "values", "what it is"), _fault_parameters),
    "recording_kinds": (("kind", "endings", "what it holds"), _recording_kinds),
    "tolerances": (("kind", "fields", "VISO_TYPE", "may differ by", "why"), _tolerances),
    "left_out": (("what", "asked for by", "what viso says"), _left_out),
    "text_exceptions": (("capture", "only recorded", "only ours", "why"), _text_exceptions),
    "rooms": (("room", "what it holds"), _rooms),
    "objectives": (("column", "unit", "what it is"), _objectives),
    "doctor_codes": (("what is wrong", "code", "at worst", "witness"), _doctor_codes),
    "web_actions": (("button", "key", "what it does"), _web_actions),
    "web_faults": (("switch", "what happens"), _web_faults),
    "scenarios": (("scenario", "what happens"), _scenarios),
    "scenario_fields": (("field", "what it is"), _scenario_fields),
    "scenario_steps": (("step", "what it takes"), _scenario_steps),
    "scenario_streams": (("field", "default", "what it is"), _scenario_streams),
    "recording_files": (("file", "what it holds"), _recording_files),
    "vio_config": (("key", "default", "values", "what it is"), _vio_config),
    "parameters": (("parameter", "type", "default", "unit", "values, documented range", "what it is"), _parameters),
}


TEXTS: Final[Mapping[str, Callable[[], Iterable[str]]]] = {
    "api": _api,
    "command_sections": _command_sections,
    "doctor_sections": _doctor_sections,
    "engine_protocol": _engine_protocol,
    "layers": _layer_section,
}


def render(name: str) -> str:
    """Return a table in Markdown.

    Raises:
        KeyError: if there is no table of that name.
    """
    head, rows = TABLES[name]
    return _in_markdown([head, tuple("---" for _ in head), *rows()])


def _in_markdown(lines: Rows) -> str:
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def refresh(text: str) -> str:
    """Return a page with its tables and sections made again."""
    return _BLOCK.sub(lambda match: match[1] + "\n" + _block(match[2], match[3]) + "\n" + match[4], text)


def _block(kind: str, name: str) -> str:
    return render(name) if kind == "table" else "\n".join(TEXTS[name]())


def main(arguments: list[str]) -> int:
    """Rewrite the pages, or with --check name those that are stale; return the exit code."""
    is_check, code = "--check" in arguments, 0
    for path in sorted(DOCS.rglob("*.md")):
        before = path.read_text(encoding="utf-8")
        after = refresh(before)
        if after != before:
            news = "stale, run .venv/bin/python tools/make_docs.py" if is_check else "rewritten"
            print(f"{path.relative_to(DOCS.parent)}: {news}")
            if is_check:
                code = 1
            else:
                path.write_text(after, encoding="utf-8")
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
