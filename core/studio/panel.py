"""The controls beside the scene: what each of them changes in the session."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..effects import catalogue
from ..errors import MbexportError
from ..signals import joint_unit
from ..simulation.backends import backend_names
from .bench import tables_of
from .knobs import REACHES, Knob, Reach, knobs, round_step, shown_unit
from .paths import Drive
from .scene import Shown
from .session import Session, View
from .words import changes, readout

_DRIVES: dict[str, Drive] = {"motion imposed on the motors": "motion", "torque of a PD controller": "pd"}
_MAGNIFICATIONS = ("so that it is seen", "1", "2", "5", "10", "20", "50", "100", "200", "500")
# joints without limits turn this far, and slide this far [deg, mm]
_FREE_TURN, _FREE_SLIDE = 180.0, 500.0
_GREY, _LINES = "#6b7480", {"x": "#009e73", "y": "#cc79a7", "z": "#e69f00", "length": "#d55e00"}


class Panel:
    """Tabs with controls, and the tip's error above them."""

    def __init__(
        self, server: Any, session: Session, changed: Callable[[], None], play: Callable[[bool], None]
    ) -> None:
        """The controls of a session.

        Args:
            server: A viser server.
            session: What the controls change.
            changed: Called where the same view must be drawn anew.
            play: Called with whether the motion shall play.
        """
        self._gui, self._session, self._changed, self._play = server.gui, session, changed, play
        self._knobs: list[tuple[Any, Knob]] = []
        self._joints: list[tuple[Any, float]] = []
        self._switches: dict[str, Any] = {}
        self._drawn_paths: Any = None
        gui = self._gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large", brand_color=(0, 114, 178))
        gui.main_panel.dock_right()
        gui.main_panel.set_width(400)
        self._readout = gui.add_html("")
        self._chart = self._add_chart()
        tabs = gui.add_tab_group()
        with tabs.add_tab("Robot"):
            self._robot_tab()
        with tabs.add_tab("Effects"):
            self._effects_tab()
        with tabs.add_tab("Numbers"):
            self._numbers_tab()
        with tabs.add_tab("Motion"):
            self._motion_tab()
        with tabs.add_tab("Files"):
            self._files_tab()

    @property
    def shown(self) -> Shown:
        """What of the scene is to be seen."""
        choice = str(self._magnify.value)
        factor = 0.0 if choice == _MAGNIFICATIONS[0] else float(choice)
        return Shown(self._frames.value, self._axes.value, self._ghost.value, factor)

    def show(self, view: View, factor: float) -> None:
        """Let the controls say what a view says."""
        self._readout.content = readout(view, self._session.motion, factor)
        self._changes.content = changes(view)
        for name, switch in self._switches.items():
            on = name in view.bench.effects
            if switch.value != on:
                switch.value = on
        for (slider, scale), position in zip(self._joints, view.posture.theta, strict=True):
            shown = min(max(float(position) / scale, slider.min), slider.max)
            if abs(slider.value - shown) > 1.0e-9:
                slider.value = shown
        if view.time is not None and abs(self._time.value - view.time) > 1.0e-9:
            self._time.value = view.time
        if view.paths is not self._drawn_paths:
            self._drawn_paths = view.paths
            self._show_chart(view)

    # tabs
    def _robot_tab(self) -> None:
        gui, session = self._gui, self._session
        view = session.view
        with gui.add_folder("Joints, at rest"):
            for i, stage in enumerate(view.robot.stages):
                joint = stage.joint
                unit, scale = shown_unit(joint_unit("q", joint.kind))
                free = _FREE_TURN if joint.kind == "revolute" else _FREE_SLIDE
                low = joint.lower / scale if math.isfinite(joint.lower) else -free
                high = joint.upper / scale if math.isfinite(joint.upper) else free
                home = min(max(joint.home / scale, low), high)
                slider = gui.add_slider(f"{i + 1} [{unit}]", low, high, round_step((high - low) / 2000.0), home)
                slider.on_update(
                    self._by_hand(lambda event, i=i, scale=scale: self._turn(i, event.target.value * scale))
                )
                self._joints.append((slider, scale))
        with gui.add_folder("Seen"):
            self._frames = gui.add_checkbox("frames", False, hint="Veitschegger-Wu frames: base, arms, tool")
            self._axes = gui.add_checkbox("joints' axes", False, hint="where the joints really are")
            self._ghost = gui.add_checkbox("robot without effects", True, hint="pale, where it differs")
            self._magnify = gui.add_dropdown("error drawn larger", _MAGNIFICATIONS, hint="of the path and of the arrow")
            for control in (self._frames, self._axes, self._ghost, self._magnify):
                control.on_update(self._by_hand(lambda event: self._changed()))

    def _effects_tab(self) -> None:
        gui, session = self._gui, self._session
        own = [name for name in catalogue() if name in session.bench.original.effects]
        others = [name for name in catalogue() if name not in own]
        for title, names in (("In the database", own), ("Others, harmless until their numbers are changed", others)):
            if not names:
                continue
            with gui.add_folder(title):
                for name in names:
                    switch = gui.add_checkbox(name.replace("_", " "), name in session.bench.effects)
                    switch.on_update(self._by_hand(lambda event, name=name: self._switch(name, event.target.value)))
                    self._switches[name] = switch

    def _numbers_tab(self) -> None:
        gui, session = self._gui, self._session
        self._columns = tables_of(session.bench.original)
        # what the paper changes comes first
        first = next((name for name in session.bench.original.effects), "inertia")
        self._table = gui.add_dropdown("table", tuple(self._columns), initial_value=first)
        self._column = gui.add_dropdown("column", self._columns[first])
        self._reach = gui.add_dropdown(
            "range", REACHES, initial_value="medium", hint="10 %, all of it, or ten times the number"
        )
        self._sliders = gui.add_folder("Values")
        self._changes = gui.add_html("")
        gui.add_button("Undo all changes").on_click(self._reset)
        self._table.on_update(self._by_hand(lambda event: self._choose_table()))
        for control in (self._column, self._reach):
            control.on_update(self._by_hand(lambda event: self._fill_sliders()))
        self._fill_sliders()

    def _motion_tab(self) -> None:
        gui, session = self._gui, self._session
        motion = gui.add_dropdown("motion", session.motions(), initial_value=session.motion)
        motion.on_update(self._by_hand(lambda event: self._choose_motion(event.target.value)))
        driven = next(name for name, drive in _DRIVES.items() if drive == session.drive)
        drive = gui.add_dropdown("driven by", tuple(_DRIVES), initial_value=driven)
        drive.on_update(self._by_hand(lambda event: session.choose_drive(_DRIVES[event.target.value])))
        self._time = gui.add_slider("time [s]", 0.0, session.duration, 0.001, 0.0)
        self._time.on_update(self._by_hand(lambda event: session.place_at(event.target.value)))
        self._playing = gui.add_checkbox("play", False)
        self._playing.on_update(self._by_hand(lambda event: self._play(event.target.value)))

    def _files_tab(self) -> None:
        gui, session = self._gui, self._session
        with gui.add_folder("Database"):
            save = gui.add_button("Save the changed database")
            save.on_click(self._save)
        with gui.add_folder("Models"):
            chosen = ("urdf", "mjcf")
            self._formats = {name: gui.add_checkbox(name, name in chosen) for name in backend_names()}
            gui.add_button("Export").on_click(self._export)
        self._written = gui.add_markdown(f"Each time into a new folder in `{session.output}`.")

    # what they do
    def _by_hand(self, act: Callable[[Any], None]) -> Callable[[Any], None]:
        """Only what a person changed counts, not what the page sets itself."""

        def maybe(event: Any) -> None:
            if event.client is not None:
                act(event)

        return maybe

    def _turn(self, joint: int, position: float) -> None:
        self._stop()
        self._session.place_joint(joint, position)

    def _stop(self) -> None:
        if self._playing.value:
            self._playing.value = False
        self._play(False)

    def _switch(self, name: str, on: bool) -> None:
        self._session.switch(name, on)
        if on and name not in self._session.bench.original.effects:
            # one that does nothing yet: here are its numbers
            self._table.value = name
            self._choose_table()

    def _reset(self, event: Any) -> None:
        self._stop()
        self._session.reset()
        self._fill_sliders()

    def _choose_table(self) -> None:
        self._column.options = self._columns[self._table.value]
        self._column.value = self._column.options[0]
        self._fill_sliders()

    def _fill_sliders(self) -> None:
        """Sliders for the chosen column, anew."""
        for slider, _ in self._knobs:
            slider.remove()
        self._knobs = []
        table, column, reach = self._table.value, self._column.value, cast("Reach", self._reach.value)
        with self._sliders:
            for knob in knobs(self._session.bench, table, column, reach):
                label = f"{knob.label} [{knob.unit}]" if knob.unit else knob.label
                slider = self._gui.add_slider(
                    label, knob.low, knob.high, knob.step, knob.value, disabled=not knob.free, hint=knob.place.name
                )
                slider.on_update(
                    self._by_hand(
                        lambda event, knob=knob: self._session.change(knob.place, knob.si(event.target.value))
                    )
                )
                self._knobs.append((slider, knob))

    def _choose_motion(self, name: str) -> None:
        self._stop()
        self._session.choose_motion(name)
        self._time.value = 0.0
        self._time.max = self._session.duration

    def _save(self, event: Any) -> None:
        self._write(self._session.save)

    def _export(self, event: Any) -> None:
        self._write(lambda: self._session.export([name for name, box in self._formats.items() if box.value]))

    def _write(self, write: Callable[[], Path]) -> None:
        try:
            told = f"Written: `{write()}`"
        except MbexportError as error:
            told = f"**Not written:** {error}"
        self._written.content = told

    # the chart
    def _add_chart(self) -> Any:
        uplot: Any = import_module("viser.uplot")
        series = [uplot.Series(label="t [s]")]
        for name, colour in _LINES.items():
            label = "error [mm]" if name == "length" else name
            series.append(uplot.Series(label=label, stroke=colour, width=2.2 if name == "length" else 1.2))
        empty = tuple(np.zeros(2) for _ in series)
        axes = (
            uplot.Axis(stroke=_GREY, size=32, grid={"stroke": "#e6e9ed"}, font="11px sans-serif"),
            uplot.Axis(stroke=_GREY, size=46, grid={"stroke": "#e6e9ed"}, font="11px sans-serif"),
        )
        return self._gui.add_uplot(
            empty, tuple(series), scales={"x": uplot.Scale(time=False, auto=True)}, axes=axes, height=170
        )

    def _show_chart(self, view: View) -> None:
        if view.paths is None:
            self._chart.data = tuple(np.zeros(2) for _ in range(5))
            return
        x, y, z = 1.0e3 * view.paths.error.T
        self._chart.data = (view.paths.t, x, y, z, 1.0e3 * view.paths.distance)
