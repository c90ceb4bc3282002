# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters: values of a group, the list, names, PARAM_SET, storage and defaults."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.param import (
    NO_INDEX,
    Param,
    ParamFlag,
    ParamGroup,
    ParamInfo,
    ParamOutcome,
    ParamTable,
    ParamType,
)
from ap_core.vector3 import Vector3f

INT8, INT16, INT32 = ParamType.INT8, ParamType.INT16, ParamType.INT32
FLOAT, VECTOR3F = ParamType.FLOAT, ParamType.VECTOR3F
REAL32 = 9

VISO_ROWS = (
    ParamInfo("_TYPE", INT8, 0, "backend", flags=ParamFlag.ENABLE),
    ParamInfo("_POS", VECTOR3F, (0.0, 0.0, 0.5), "camera position", "m"),
    ParamInfo("_ORIENT", INT8, 0, "orientation"),
    ParamInfo("_SCALE", FLOAT, 1.0, "scale"),
    ParamInfo("_DELAY_MS", INT16, 10, "delay", "ms"),
    ParamInfo("_LOCKED", INT16, 7, "cannot be changed", flags=ParamFlag.READ_ONLY),
)
OTHER_ROWS = (
    ParamInfo("MASK", INT32, 180222, "bits"),
    ParamInfo("SECRET", INT8, 0, "not listed", flags=ParamFlag.HIDDEN),
    ParamInfo("TRIM", VECTOR3F, (0.0, 0.0, 0.0), "trim"),
)


def make_table(viso_type: int = 1) -> ParamTable:
    return ParamTable(
        [
            ParamGroup("", [ParamInfo("FORMAT_VERSION", INT16, 120, "format")], ungrouped=True),
            ParamGroup("AHRS_", OTHER_ROWS, top_level_prefix="AHRS_"),
            ParamGroup("VISO", VISO_ROWS, defaults={"_TYPE": viso_type}),
        ]
    )


def echoes_of(table: ParamTable, name: str, value: float) -> list[tuple[str, float, int]]:
    return [(echo.name, float(echo.value), echo.wire_type) for echo in table.set_from_mavlink(name, value).echoes]


def found(table: ParamTable, name: str) -> Param:
    param = table.find(name)
    assert param is not None
    return param


def value_and_default(param: Param) -> tuple[float, float]:
    return float(param.value), float(param.default)


class TestParamType:
    @pytest.mark.parametrize(("kind", "wire_type"), [(INT8, 2), (INT16, 4), (INT32, 6), (FLOAT, 9), (VECTOR3F, 9)])
    def test_wire_type_is_the_mavlink_number(self, kind: ParamType, wire_type: int) -> None:
        assert kind.wire_type == wire_type


class TestParamInfo:
    @pytest.mark.parametrize(("kind", "default"), [(VECTOR3F, 0.0), (FLOAT, (0.0, 0.0, 0.0))])
    def test_default_must_fit_the_type(self, kind: ParamType, default: float | tuple[float, float, float]) -> None:
        with pytest.raises(ValueError, match="default"):
            ParamInfo("_A", kind, default, "")


class TestParamGroup:
    def test_starts_with_defaults(self) -> None:
        group = ParamGroup("VISO", VISO_ROWS)
        assert group.get_int("_DELAY_MS") == 10
        assert group.get_float("_SCALE") == np.float32(1.0)
        assert group.get_vector("_POS") == Vector3f(0.0, 0.0, 0.5)

    def test_vehicle_defaults_replace_those_of_the_table(self) -> None:
        group = ParamGroup("VISO", VISO_ROWS, defaults={"_DELAY_MS": 30, "_POS_Y": 0.1})
        assert group.get_int("_DELAY_MS") == 30
        assert group.get_vector("_POS") == Vector3f(0.0, 0.1, 0.5)

    def test_float_is_stored_as_float32(self) -> None:
        group = ParamGroup("VISO", VISO_ROWS)
        group.set("_SCALE", 0.1)
        assert isinstance(group.get_float("_SCALE"), np.float32)
        assert group.get_float("_SCALE") == np.float32(0.1)

    @pytest.mark.parametrize(("given_value", "stored"), [(1.9, 1), (-1.9, -1), (300, 44), (128, -128)])
    def test_programmatic_integer_is_truncated_to_the_width(self, given_value: float, stored: int) -> None:
        group = ParamGroup("VISO", VISO_ROWS)
        group.set("_ORIENT", given_value)
        assert group.get_int("_ORIENT") == stored

    def test_vector_can_be_set_whole_and_by_element(self) -> None:
        group = ParamGroup("VISO", VISO_ROWS)
        group.set("_POS", Vector3f(1.0, 2.0, 3.0))
        group.set("_POS_Y", -2.5)
        assert group.get_vector("_POS") == Vector3f(1.0, -2.5, 3.0)
        assert group.get_float("_POS_Z") == np.float32(3.0)

    @pytest.mark.parametrize("value", [math.nan, math.inf])
    def test_integer_cannot_be_set_to_a_non_finite_number(self, value: float) -> None:
        with pytest.raises(ValueError, match="integer"):
            ParamGroup("VISO", VISO_ROWS).set("_ORIENT", value)

    @pytest.mark.parametrize("name", ["_SCALE", "_POS", "_NONE"])
    def test_get_int_refuses_other_names(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"VISO{name}"):
            ParamGroup("VISO", VISO_ROWS).get_int(name)

    @pytest.mark.parametrize("name", ["_TYPE", "_POS", "_NONE"])
    def test_get_float_refuses_other_names(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"VISO{name}"):
            ParamGroup("VISO", VISO_ROWS).get_float(name)

    @pytest.mark.parametrize("name", ["_TYPE", "_POS_X", "_NONE"])
    def test_get_vector_refuses_other_names(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"VISO{name}"):
            ParamGroup("VISO", VISO_ROWS).get_vector(name)

    @pytest.mark.parametrize("name", ["_POS", "_NONE"])
    def test_set_number_refuses_names_that_are_not_scalars(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"VISO{name}"):
            ParamGroup("VISO", VISO_ROWS).set(name, 1.0)

    def test_set_vector_refuses_a_scalar(self) -> None:
        with pytest.raises(ValueError, match="VISO_SCALE"):
            ParamGroup("VISO", VISO_ROWS).set("_SCALE", Vector3f(1.0, 2.0, 3.0))

    def test_unknown_vehicle_default_is_an_error(self) -> None:
        with pytest.raises(ValueError, match="VISO_NONE"):
            ParamGroup("VISO", VISO_ROWS, defaults={"_NONE": 1})

    def test_name_of_more_than_16_characters_is_an_error(self) -> None:
        with pytest.raises(ValueError, match="longer than 16"):
            ParamGroup("LONG_PREFIX", [ParamInfo("_VALUE", INT8, 0, "")])

    def test_top_level_prefix_must_start_the_prefix(self) -> None:
        with pytest.raises(ValueError, match="does not start with"):
            ParamGroup("VISO", VISO_ROWS, top_level_prefix="EK3_")

    @pytest.mark.parametrize("kind", [INT8, INT16])
    def test_enable_flag_belongs_to_a_first_row_of_type_int8(self, kind: ParamType) -> None:
        enable = ParamInfo("_ENABLE", kind, 0, "", flags=ParamFlag.ENABLE)
        rows = [enable] if kind is INT16 else [ParamInfo("_A", INT8, 0, ""), enable]
        with pytest.raises(ValueError, match="A_ENABLE"):
            ParamGroup("A", rows)

    def test_group_without_rows_lists_nothing(self) -> None:
        assert ParamGroup("A", []).listed_slots == ()


class TestListing:
    def test_vectors_are_listed_by_element_and_hidden_rows_not_at_all(self) -> None:
        assert [param.name for param in make_table()] == [
            "FORMAT_VERSION",
            "AHRS_MASK",
            "AHRS_TRIM_X",
            "AHRS_TRIM_Y",
            "AHRS_TRIM_Z",
            "VISO_TYPE",
            "VISO_POS_X",
            "VISO_POS_Y",
            "VISO_POS_Z",
            "VISO_ORIENT",
            "VISO_SCALE",
            "VISO_DELAY_MS",
            "VISO_LOCKED",
        ]

    def test_indices_count_from_0(self) -> None:
        table = make_table()
        assert [param.index for param in table] == list(range(table.count))
        assert list(table) == [table.by_index(index) for index in range(table.count)]

    def test_disabled_group_lists_only_its_enabling_parameter(self) -> None:
        table = make_table(viso_type=0)
        assert [param.name for param in table][5:] == ["VISO_TYPE"]
        assert table.count == 6

    def test_count_follows_the_enabling_parameter_at_once(self) -> None:
        table = make_table(viso_type=0)
        table.set_from_mavlink("VISO_TYPE", 1)
        assert table.count == 13
        table.group("VISO").set("_TYPE", 0)
        assert table.count == 6

    def test_disabled_parameters_can_be_read_and_set_by_name(self) -> None:
        table = make_table(viso_type=0)
        table.set_from_mavlink("VISO_DELAY_MS", 20)
        assert found(table, "VISO_DELAY_MS").value == 20

    @pytest.mark.parametrize("index", [-1, 13, 70000])
    def test_index_outside_the_list_gives_nothing(self, index: int) -> None:
        assert make_table().by_index(index) is None

    def test_param_tells_type_value_and_default(self) -> None:
        table = make_table()
        table.set("AHRS_TRIM_Y", 0.1)
        param = table.by_index(3)
        assert param is not None
        assert param.type is FLOAT
        assert value_and_default(param) == (float(np.float32(0.1)), 0.0)

    def test_raw_keeps_all_digits_of_an_int32(self) -> None:
        table = make_table()
        table.set("AHRS_MASK", 16777217)
        assert (found(table, "AHRS_MASK").raw, float(found(table, "AHRS_MASK").value)) == (16777217, 16777216.0)

    def test_same_name_twice_is_an_error(self) -> None:
        with pytest.raises(ValueError, match="VISO_TYPE: defined twice"):
            ParamTable([ParamGroup("VISO", VISO_ROWS), ParamGroup("VISO", VISO_ROWS)])


class TestAccessByFullName:
    def test_values_are_live(self) -> None:
        table = make_table()
        table.group("VISO").set("_DELAY_MS", 42)
        assert table.get_int("VISO_DELAY_MS") == 42

    def test_float_and_vector_element(self) -> None:
        table = make_table()
        table.set("VISO_SCALE", 2.0)
        assert table.get_float("VISO_SCALE") == 2.0
        assert table.get_float("VISO_POS_Z") == 0.5

    @pytest.mark.parametrize("name", ["viso_type", "VISO_POS", ""])
    def test_spelling_is_exact(self, name: str) -> None:
        with pytest.raises(ValueError, match="no such parameter"):
            make_table().get_int(name)
        with pytest.raises(ValueError, match="no such parameter"):
            make_table().get_number(name)

    @pytest.mark.parametrize(("name", "value"), [
        ("VISO_DELAY_MS", 10.0),
        ("VISO_SCALE", 1.0),
        ("VISO_POS_Z", 0.5),
        ("AHRS_MASK", 180222.0),
        ("FORMAT_VERSION", 120.0),
    ])  # fmt: skip
    def test_number_of_any_type_is_a_plain_float(self, name: str, value: float) -> None:
        number = make_table().get_number(name)
        assert (number, type(number)) == (value, float)

    def test_generation_grows_with_every_value_stored_even_the_same(self) -> None:
        table = make_table()
        seen = [table.generation]
        table.set("VISO_SCALE", 2.0)
        seen.append(table.generation)
        table.set_from_mavlink("VISO_SCALE", 2.0)
        seen.append(table.generation)
        table.get_float("VISO_SCALE")
        assert seen[0] < seen[1] < seen[2] == table.generation

    def test_unknown_group_is_an_error(self) -> None:
        with pytest.raises(ValueError, match="EK3_"):
            make_table().group("EK3_")


class TestNameMatching:
    @pytest.mark.parametrize(
        ("spelled", "canonical"),
        [
            ("viso_type", "VISO_TYPE"),
            ("ViSo_Delay_Ms", "VISO_DELAY_MS"),
            ("viso_POS_X", "VISO_POS_X"),
            ("VISO_POS_Ybc", "VISO_POS_Y"),
            ("AHRS_mask", "AHRS_MASK"),
            ("format_version", "FORMAT_VERSION"),
            ("AHRS_SECRET", "AHRS_SECRET"),
        ],
    )
    def test_found_with_the_spelling_of_the_request(self, spelled: str, canonical: str) -> None:
        param = found(make_table(), spelled)
        assert (param.name, param.canonical_name, param.index) == (spelled, canonical, NO_INDEX)

    @pytest.mark.parametrize(
        "name",
        [
            "ahrs_MASK",
            "VISO_POS_x",
            "viso_pos_X",
            "VISO_POS_",
            "VISO_POS_W",
            "VISO_TYPE2",
            "VISO",
            "",
            "VI\u0130SO_TYPE",
            "A\u212a",
        ],
    )
    def test_unknown(self, name: str) -> None:
        assert make_table().find(name) is None

    @pytest.mark.parametrize("name", ["VISO_POS", "viso_pos"])
    def test_whole_vector_is_a_float_of_value_nan(self, name: str) -> None:
        param = found(make_table(), name)
        assert (param.type.wire_type, param.name, param.canonical_name) == (REAL32, name, "VISO_POS")
        assert math.isnan(param.value)


class TestSetFromMavlink:
    @pytest.mark.parametrize(
        ("name", "value", "stored"),
        [
            ("VISO_ORIENT", 10.6, 10),
            ("VISO_ORIENT", -10.6, -10),
            ("VISO_ORIENT", 9.99, 10),
            ("VISO_ORIENT", 9.98, 9),
            ("VISO_ORIENT", -9.99, -10),
            ("VISO_ORIENT", 300, 127),
            ("VISO_ORIENT", -300, -128),
            ("VISO_DELAY_MS", 99999, 32767),
            ("VISO_DELAY_MS", -99999, -32768),
            ("AHRS_MASK", 3e9, 2147483647),
            ("AHRS_MASK", -3e9, -2147483648),
            ("VISO_TYPE", 99, 99),
        ],
    )
    def test_integers_round_up_by_a_hundredth_saturate_and_truncate(self, name: str, value: float, stored: int) -> None:
        table = make_table()
        result = table.set_from_mavlink(name, value)
        assert result.outcome is ParamOutcome.SET
        assert table.get_int(name) == stored

    def test_tells_the_values_before_and_after(self) -> None:
        result = make_table().set_from_mavlink("VISO_DELAY_MS", 20.5)
        assert [float(result.previous), float(result.value)] == [10.0, 20.0]

    def test_echo_has_the_canonical_name_and_the_stored_type(self) -> None:
        assert echoes_of(make_table(), "viso_delay_ms", 20) == [("VISO_DELAY_MS", 20.0, INT16.wire_type)]

    def test_unknown_name_does_nothing(self) -> None:
        result = make_table().set_from_mavlink("VISO_NONE", 1)
        assert (result.outcome, result.echoes) == (ParamOutcome.UNKNOWN, ())

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300])
    def test_non_finite_value_does_nothing(self, value: float) -> None:
        table = make_table()
        result = table.set_from_mavlink("VISO_SCALE", value)
        assert (result.outcome, result.echoes) == (ParamOutcome.NOT_FINITE, ())
        assert result.previous == 1.0
        assert table.get_float("VISO_SCALE") == 1.0

    def test_read_only_answers_with_the_name_as_sent_and_the_old_value(self) -> None:
        table = make_table()
        result = table.set_from_mavlink("viso_locked", 8)
        assert (result.outcome, table.get_int("VISO_LOCKED")) == (ParamOutcome.READ_ONLY, 7)
        assert [(e.name, float(e.value), e.wire_type) for e in result.echoes] == [("viso_locked", 7.0, 4)]

    def test_default_value_that_was_never_stored_is_echoed_as_float(self) -> None:
        assert echoes_of(make_table(), "VISO_DELAY_MS", 10) == [("VISO_DELAY_MS", 10.0, REAL32)]

    def test_default_value_of_a_top_level_parameter_keeps_its_type(self) -> None:
        assert echoes_of(make_table(), "FORMAT_VERSION", 120) == [("FORMAT_VERSION", 120.0, INT16.wire_type)]

    def test_default_value_is_not_stored(self) -> None:
        table = make_table()
        table.set_from_mavlink("VISO_DELAY_MS", 10)
        assert "VISO_DELAY_MS" not in table.stored_values()

    def test_request_that_differs_before_rounding_is_stored_even_as_the_default(self) -> None:
        table = make_table()
        assert echoes_of(table, "VISO_DELAY_MS", 10.6) == [("VISO_DELAY_MS", 10.0, INT16.wire_type)]
        assert "VISO_DELAY_MS" in table.stored_values()

    def test_back_to_the_default_is_stored_and_keeps_its_type(self) -> None:
        table = make_table()
        table.set_from_mavlink("VISO_DELAY_MS", 11)
        assert echoes_of(table, "VISO_DELAY_MS", 10) == [("VISO_DELAY_MS", 10.0, INT16.wire_type)]
        assert echoes_of(table, "VISO_DELAY_MS", 10) == [("VISO_DELAY_MS", 10.0, INT16.wire_type)]

    def test_unchanged_value_that_differs_from_the_default_is_stored(self) -> None:
        table = make_table()
        table.set("VISO_DELAY_MS", 12)
        assert echoes_of(table, "VISO_DELAY_MS", 12) == [("VISO_DELAY_MS", 12.0, INT16.wire_type)]
        assert "VISO_DELAY_MS" in table.stored_values()

    def test_unchanged_value_within_a_hundredth_percent_of_the_default_is_not_stored(self) -> None:
        table = make_table()
        table.set("VISO_SCALE", 1.00005)
        assert echoes_of(table, "VISO_SCALE", float(table.get_float("VISO_SCALE"))) == [("VISO_SCALE", 1.0, REAL32)]
        assert "VISO_SCALE" not in table.stored_values()

    def test_int32_near_the_default_is_stored(self) -> None:
        table = make_table()
        table.set("AHRS_MASK", 180223)
        assert echoes_of(table, "AHRS_MASK", 180223) == [("AHRS_MASK", 180223.0, INT32.wire_type)]

    def test_first_element_of_a_vector_echoes_all_three(self) -> None:
        assert echoes_of(make_table(), "VISO_POS_X", 0.25) == [
            ("VISO_POS_X", 0.25, REAL32),
            ("VISO_POS_Y", 0.0, REAL32),
            ("VISO_POS_Z", 0.5, REAL32),
        ]

    @pytest.mark.parametrize("name", ["VISO_POS_Y", "VISO_POS_Z"])
    def test_other_elements_echo_only_themselves(self, name: str) -> None:
        assert echoes_of(make_table(), name, 0.25) == [(name, 0.25, REAL32)]

    def test_element_stores_its_whole_vector_even_at_the_default(self) -> None:
        table = make_table()
        table.set_from_mavlink("VISO_POS_Y", 0)
        assert table.stored_values() == {"VISO_POS_X": 0.0, "VISO_POS_Y": 0.0, "VISO_POS_Z": 0.5}

    def test_whole_vector_changes_nothing_and_echoes_all_three(self) -> None:
        table = make_table()
        result = table.set_from_mavlink("VISO_POS", 3)
        assert [float(echo.value) for echo in result.echoes] == [0.0, 0.0, 0.5]
        assert result.outcome is ParamOutcome.SET
        assert math.isnan(result.previous)

    def test_hidden_parameter_is_set_without_echo(self) -> None:
        table = make_table()
        assert echoes_of(table, "AHRS_SECRET", 1) == []
        assert table.get_int("AHRS_SECRET") == 1

    @given(
        name=st.sampled_from(["VISO_ORIENT", "VISO_DELAY_MS", "AHRS_MASK", "VISO_SCALE", "VISO_POS_X", "VISO_POS"]),
        values=st.lists(st.floats(), max_size=3),
    )
    def test_any_number_leaves_a_value_that_its_type_can_hold(self, name: str, values: list[float]) -> None:
        table = make_table()
        for value in values:
            table.set_from_mavlink(name, value)
        assert -128 <= table.get_int("VISO_ORIENT") <= 127
        assert -32768 <= table.get_int("VISO_DELAY_MS") <= 32767
        assert -(2**31) <= table.get_int("AHRS_MASK") < 2**31
        assert np.isfinite(table.get_float("VISO_SCALE"))

    @given(name=st.text(max_size=20))
    def test_any_name_has_an_outcome(self, name: str) -> None:
        assert make_table().set_from_mavlink(name, 1.0).outcome in ParamOutcome


class TestStorage:
    def test_stored_values_survive_a_restart(self) -> None:
        before = make_table()
        before.set_from_mavlink("VISO_DELAY_MS", 33)
        before.set_from_mavlink("VISO_POS_X", 0.1)
        after = make_table()
        assert after.load_stored(before.stored_values()) == []
        assert after.get_int("VISO_DELAY_MS") == 33
        assert after.get_float("VISO_POS_X") == np.float32(0.1)
        assert "VISO_DELAY_MS" in after.stored_values()

    def test_value_set_in_memory_is_not_remembered(self) -> None:
        table = make_table()
        table.set("VISO_DELAY_MS", 33)
        assert table.stored_values() == {}

    def test_change_of_what_is_remembered_is_noted(self) -> None:
        table = make_table()
        table.set("VISO_DELAY_MS", 33)
        assert table.stored_generation == 0
        table.set_from_mavlink("VISO_DELAY_MS", 34)
        assert table.stored_generation == 1
        table.forget_stored()
        assert table.stored_generation == 2

    def test_stored_names_that_no_longer_exist_are_reported(self) -> None:
        assert make_table().load_stored({"VISO_GONE": 1.0, "VISO_DELAY_MS": 5}) == ["VISO_GONE"]


class TestDefaults:
    def test_default_becomes_value_and_default(self) -> None:
        table = make_table()
        assert table.apply_defaults({"VISO_DELAY_MS": 50}, "a.parm") == []
        param = found(table, "VISO_DELAY_MS")
        assert value_and_default(param) == (50, 50)

    def test_stored_value_stays(self) -> None:
        table = make_table()
        table.load_stored({"VISO_DELAY_MS": 33})
        table.apply_defaults({"VISO_DELAY_MS": 50}, "a.parm")
        param = found(table, "VISO_DELAY_MS")
        assert value_and_default(param) == (33, 50)

    def test_unknown_names_are_reported_in_order(self) -> None:
        assert make_table().apply_defaults({"B": 1, "VISO_TYPE": 1, "A": 1}, "a.parm") == ["B", "A"]

    def test_value_is_converted_as_over_mavlink(self) -> None:
        table = make_table()
        table.apply_defaults({"VISO_ORIENT": 300}, "a.parm")
        assert found(table, "VISO_ORIENT").value == 127

    def test_last_file_gives_the_value_and_first_file_the_default(self) -> None:
        table = make_table()
        table.apply_defaults({"VISO_DELAY_MS": 20}, "a.parm")
        table.apply_defaults({"VISO_DELAY_MS": 30}, "b.parm")
        param = found(table, "VISO_DELAY_MS")
        assert value_and_default(param) == (30, 20)

    def test_file_default_is_what_an_echo_compares_with(self) -> None:
        table = make_table()
        table.apply_defaults({"VISO_DELAY_MS": 50}, "a.parm")
        assert echoes_of(table, "VISO_DELAY_MS", 50) == [("VISO_DELAY_MS", 50.0, REAL32)]

    def test_read_only_default_cannot_be_set_over_mavlink(self) -> None:
        table = make_table()
        table.apply_defaults({"viso_type": 2}, "a.parm", read_only={"viso_type"})
        assert table.set_from_mavlink("VISO_TYPE", 1).outcome is ParamOutcome.READ_ONLY

    def test_format_version_is_skipped(self) -> None:
        table = make_table()
        assert table.apply_defaults({"FORMAT_VERSION": 1}, "a.parm") == []
        assert table.get_int("FORMAT_VERSION") == 120

    def test_name_of_a_whole_vector_changes_only_the_default_of_its_first_element(self) -> None:
        table = make_table()
        table.apply_defaults({"VISO_POS": 3}, "a.parm")
        param = found(table, "VISO_POS_X")
        assert value_and_default(param) == (0, 3)

    def test_non_finite_default_is_an_error(self) -> None:
        with pytest.raises(ValueError, match="VISO_SCALE"):
            make_table().apply_defaults({"VISO_SCALE": math.nan}, "a.parm")
