"""The operator's buttons: choose who, press what, confirm; nothing is sent before the confirmation."""

from __future__ import annotations

import time
from collections.abc import Callable

from bokeh.models import Button, Column, Div, InlineStyleSheet, Row, Select

from gcs.dashboard.board import Board
from gcs.dashboard.styles import BUTTONS, DIALOG, TEXT
from gcs.operator_desk import Action, Order

__all__ = ["OrderBar", "question"]

_PATIENCE_S = 15.0
"""A question that nobody answers goes away."""

_ARMED_S = 5.0
"""The emergency stop does so sooner: who means it confirms at once."""

_EVERYBODY = "all"
_ONBOARD = (Action.START, Action.PAUSE, Action.RESUME, Action.FINISH)
_AUTOPILOT = (Action.HOLD, Action.LAND, Action.RETURN)
_KINDS = {
    Action.START: "success",
    Action.PAUSE: "primary",
    Action.RESUME: "success",
    Action.FINISH: "primary",
    Action.HOLD: "warning",
    Action.LAND: "warning",
    Action.RETURN: "warning",
    Action.STOP: "danger",
}
_MEANING = {
    Action.START: "arm, take off and fly the mission",
    Action.PAUSE: "hold the place until resumed",
    Action.RESUME: "fly plans again",
    Action.FINISH: "end the mission: fly home, then land",
    Action.HOLD: "the autopilot stops and holds its place; the onboard process lets go and cannot resume",
    Action.LAND: "the autopilot lands where it is",
    Action.RETURN: "the autopilot's own return: climbs as it is configured, flies home, lands",
    Action.STOP: "MOTORS OFF at once: what flies falls",
}


def question(order: Order, team_size: int) -> str:
    """What the operator is asked before an order goes out."""
    count = len(order.vehicles)
    who = f"all {count} vehicles" if count == team_size and count > 1 else f"vehicle {order.vehicles[0]}"
    return f"{order.action.value} {who}? ({_MEANING[order.action]})"


class OrderBar:
    """Buttons, the question, and its two answers.

    Args:
        board: Who flies, and where orders go.
        clock: Monotonic time, s.

    Attributes:
        row: The root to be placed on the page.
    """

    def __init__(self, board: Board, clock: Callable[[], float] = time.monotonic) -> None:
        self._board = board
        self._clock = clock
        self._ids = tuple(vehicle.id for vehicle in board.scenario.vehicles)
        self._pending: tuple[Order, float] | None = None
        style = InlineStyleSheet(css=BUTTONS)
        self.choice = Select(
            value=_EVERYBODY,
            options=[(_EVERYBODY, "all vehicles"), *((str(i), f"vehicle {i}") for i in self._ids)],
            width=120,
            stylesheets=[style],
        )
        self.buttons = {
            action: Button(
                label=action.value, button_type=kind, stylesheets=[style], name=f"order-{action.name.lower()}",
                width=128 if action is Action.STOP else 66,
            )
            for action, kind in _KINDS.items()
        }  # fmt: skip
        for action, button in self.buttons.items():
            button.on_click(lambda action=action: self._ask(action))
        text = InlineStyleSheet(css=TEXT)
        self.question = Div(text="", stylesheets=[text], sizing_mode="stretch_width")
        self.yes = Button(label="Confirm", button_type="danger", width=132, stylesheets=[style])
        self.no = Button(label="Cancel", button_type="default", width=66, stylesheets=[style])
        self._dialog = Row(
            children=[self.yes, self.no, self.question],
            visible=False,
            sizing_mode="stretch_width",
            stylesheets=[InlineStyleSheet(css=DIALOG)],
        )
        self.yes.on_click(self._confirm)
        self.no.on_click(self._clear)
        self.choice.on_change("value", lambda attr, old, new: self._clear())

        def caption(words: str) -> Div:
            return Div(text=f"<span class='caption'>{words}</span>", stylesheets=[text])

        buttons = Row(
            sizing_mode="stretch_width",
            children=[
                self.choice,
                caption("onboard"),
                *(self.buttons[action] for action in _ONBOARD),
                caption("autopilot"),
                *(self.buttons[action] for action in _AUTOPILOT),
                self.buttons[Action.STOP],
            ],
        )
        self.row = Column(name="orders", sizing_mode="stretch_width", children=[buttons, self._dialog])

    def refresh(self) -> None:
        """Enable the buttons once the flight's side is there; drop a question that is old."""
        reachable = self._board.moment is not None
        for button in self.buttons.values():
            if button.disabled is reachable:
                button.disabled = not reachable
        if self._pending is not None and self._clock() > self._pending[1]:
            self._clear()

    def _ask(self, action: Action) -> None:
        vehicles = self._ids if self.choice.value == _EVERYBODY else (int(str(self.choice.value)),)
        order = Order(action, vehicles)
        stop = action is Action.STOP
        self._pending = (order, self._clock() + (_ARMED_S if stop else _PATIENCE_S))
        self.question.text = f"<b class='{'stop' if stop else 'ask'}'>{question(order, len(self._ids))}</b>"
        self.yes.label = "MOTORS OFF" if stop else f"Confirm {action.value.lower()}"
        self._dialog.visible = True

    def _confirm(self) -> None:
        if self._pending is not None and self._clock() <= self._pending[1]:
            self._board.feed.order(self._pending[0])
        self._clear()

    def _clear(self) -> None:
        self._pending = None
        self._dialog.visible = False
