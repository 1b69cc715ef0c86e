"""Style sheets of bokeh's widgets; their colours are the page's CSS variables."""

__all__ = ["BUTTONS", "DIALOG", "EVENTS", "TABLE", "TEXT"]

_COMMON = """
:host { font: 13px/1.35 system-ui, "Segoe UI", "Noto Sans", sans-serif; color: var(--ink); }
.bk-clearfix { display: block !important; width: 100%; }
.dim, i { color: var(--dim); font-style: normal; }
b.id { color: #fff; border-radius: 9px; padding: 0 6px; font-weight: 700; }
"""

TEXT = (
    _COMMON
    + """
.line { display: flex; gap: clamp(7px, 1.4vw, 18px); align-items: baseline; white-space: nowrap; overflow: hidden; }
b { font-size: 15px; }
.phase { font-weight: 700; color: var(--good); font-size: 15px; }
.alarm { font-weight: 700; color: var(--alarm); background: var(--alarm-fill); padding: 0 8px; border-radius: 4px; }
.fact { font-variant-numeric: tabular-nums; font-weight: 600; }
.fact i { font-weight: 400; }
.ask { color: var(--alarm); font-size: 13px; }
.stop { color: #fff; background: #b3261e; font-size: 13px; padding: 3px 8px; border-radius: 4px; }
.caption { color: var(--dim); font-size: 12px; line-height: 27px; white-space: nowrap; padding-left: 8px; }
"""
)

TABLE = (
    _COMMON
    + """
table { border-collapse: collapse; width: 100%; font-size: 12px; font-variant-numeric: tabular-nums; }
th {
  position: sticky; top: 0; background: var(--panel); color: var(--dim); font-weight: 500; text-align: right;
  padding: 3px 5px; border-bottom: 1px solid var(--line); white-space: nowrap;
}
td { padding: 2px 5px; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--line); }
th:nth-child(-n+4), td:nth-child(-n+4), th:last-child, td.text { text-align: left; }
td.text { max-width: 0; width: 100%; overflow: hidden; text-overflow: ellipsis; color: var(--dim); }
td.bad { color: var(--alarm); font-weight: 700; }
td.warn { color: var(--warn); font-weight: 700; }
tr.silent td { background: var(--alarm-fill); }
td em { font-style: normal; text-decoration: underline; }
"""
)

EVENTS = (
    _COMMON
    + """
p { margin: 0; padding: 1px 8px; font-size: 12px; overflow-wrap: anywhere; }
time { color: var(--dim); font-variant-numeric: tabular-nums; }
.emergency, .alert, .critical, .error, .refused, .timed_out { color: var(--alarm); }
.warning { color: var(--warn); }
.acknowledged b { color: var(--good); }
"""
)

BUTTONS = """
:host { --font-size: 13px; font-family: system-ui, "Segoe UI", "Noto Sans", sans-serif; color: var(--ink); }
.bk-btn { padding: 3px 6px; border-radius: 4px; font-weight: 600; }
.bk-btn-primary { background: #0072b2; border-color: #0072b2; color: #fff; }
.bk-btn-success { background: #00775a; border-color: #00775a; color: #fff; }
.bk-btn-warning { background: #8a5f00; border-color: #8a5f00; color: #fff; }
.bk-btn-danger { background: #b3261e; border-color: #b3261e; color: #fff; }
.bk-btn-default, .bk-btn-default:hover { background: var(--input); border-color: var(--line); color: var(--ink); }
.bk-btn[disabled] { opacity: 0.45; }
.bk-input, select.bk-input, input.bk-input {
  background-color: var(--input); color: var(--ink); border: 1px solid var(--line); height: 27px; min-height: 27px;
  padding: 2px 8px; border-radius: 4px;
}
.bk-input-group { flex-direction: row; align-items: center; gap: 6px; }
.bk-input-group > label { color: var(--dim); white-space: nowrap; margin: 0; }
"""

# Below what asks, above all else: the page does not move under a finger that is about to confirm.
DIALOG = """
:host {
  position: absolute; top: 100%; left: 0; z-index: 20; box-sizing: border-box; padding: 3px 4px; align-items: center;
  background: var(--panel); border: 2px solid var(--alarm); border-radius: 5px;
  box-shadow: 0 4px 12px rgba(0, 0, 0, 0.35);
}
"""
