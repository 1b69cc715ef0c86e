"""The operator's buttons: choose who, press what, confirm; nothing is sent before the confirmation."""

from __future__ import annotations

import time
from collections.abc import Callable

from bokeh.models import Button, Div, InlineStyleSheet, Row, Select

from gcs.dashboard.board import Board
from gcs.dashboard.styles import BUTTONS, TEXT
from gcs.operator_desk import Action, Order

__all__ = ["OrderBar", "question"]

_PATIENCE_S = 15.0
"""A question that nobody answers goes away."""

_EVERYBODY = "all"
_MEANING = {
    Action.PAUSE: "hold their place",
    Action.RESUME: "fly their plans again",
    Action.LAND: "end the mission: fly home and land; those without onboard process land where they are",
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
        kinds = {Action.PAUSE: "primary", Action.RESUME: "success", Action.LAND: "danger"}
        self.buttons = {
            action: Button(label=action.value, button_type=kind, width=78, stylesheets=[style], name=f"order-{kind}")
            for action, kind in kinds.items()
        }
        for action, button in self.buttons.items():
            button.on_click(lambda action=action: self._ask(action))
        self.question = Div(text="", visible=False, stylesheets=[InlineStyleSheet(css=TEXT)])
        self.yes = Button(label="Confirm", button_type="danger", width=90, visible=False, stylesheets=[style])
        self.no = Button(label="Cancel", button_type="default", width=80, visible=False, stylesheets=[style])
        self.yes.on_click(self._confirm)
        self.no.on_click(self._clear)
        self.choice.on_change("value", lambda attr, old, new: self._clear())
        self.row = Row(
            name="orders",
            sizing_mode="stretch_width",
            children=[self.choice, *self.buttons.values(), self.question, self.yes, self.no],
        )

    def refresh(self) -> None:
        """Enable the buttons once the flight's side is there; drop a question that is old."""
        reachable = self._board.moment is not None
        for button in self.buttons.values():
            if button.disabled is reachable:
                button.disabled = not reachable
        if self._pending is not None and self._clock() > self._pending[1] + _PATIENCE_S:
            self._clear()

    def _ask(self, action: Action) -> None:
        vehicles = self._ids if self.choice.value == _EVERYBODY else (int(str(self.choice.value)),)
        order = Order(action, vehicles)
        self._pending = (order, self._clock())
        self.question.text = f"<b class='ask'>{question(order, len(self._ids))}</b>"
        self.yes.label = f"Confirm {action.value.lower()}"
        for widget in (self.question, self.yes, self.no):
            widget.visible = True

    def _confirm(self) -> None:
        if self._pending is not None:
            self._board.feed.order(self._pending[0])
        self._clear()

    def _clear(self) -> None:
        self._pending = None
        for widget in (self.question, self.yes, self.no):
            widget.visible = False
