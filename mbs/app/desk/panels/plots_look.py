"""The look of panels with forms and plots: small fields in rows and grids."""

from __future__ import annotations

from weakref import WeakSet

from nicegui import ui
from nicegui.client import Client

_CSS = """
.desk-small .q-field__control, .desk-small .q-field__marginal { height: 30px; min-height: 30px; }
.desk-small .q-field__native { min-height: 30px; padding: 0; font-size: 13px;
  font-variant-numeric: tabular-nums; }
.desk-small .q-field__control { padding: 0 8px; }
.desk-laws { display: grid; gap: 4px 8px; align-items: center; width: 100%;
  grid-template-columns: minmax(34px, auto) 82px 82px 112px minmax(170px, 1fr); }
.desk-cards { display: grid; gap: 14px; width: 100%; align-items: start;
  grid-template-columns: repeat(auto-fit, minmax(330px, 1fr)); }
.desk-card { border: 1px solid var(--d-line); border-radius: 10px; padding: 12px 14px; gap: 9px;
  display: flex; flex-direction: column; align-items: start; min-width: 0; }
.desk-card-title { font-weight: 600; font-size: 14.5px; }
.desk-halves { display: flex; align-items: flex-start; gap: 22px; width: 100%; }
.desk-half { display: flex; flex-direction: column; gap: 8px; min-width: 0; }
.desk-stays { flex: 1 1 0; align-self: flex-start; position: sticky; top: 12px; width: 100%; }
.desk-result-head { display: flex; align-items: center; gap: 8px; width: 100%; flex-wrap: wrap; }
.desk-residuals { display: grid; width: 100%; gap: 4px 12px;
  grid-template-columns: minmax(0, 3fr) minmax(0, 2fr); }
.desk-panel .q-table__card { background: transparent; color: inherit; }
.desk-player { display: flex; align-items: center; gap: 12px; width: 100%; }
.desk-player .q-slider * { transition: none !important; }
@media (max-width: 1100px) { .desk-halves { flex-direction: column; }
  .desk-stays { position: static; flex: none; } }
"""

_DONE: WeakSet[Client] = WeakSet()


def add_look() -> None:
    """Give the page these styles, once."""
    client = ui.context.client
    if client not in _DONE:
        _DONE.add(client)
        ui.add_css(_CSS)


def come_into_view(element: ui.element) -> None:
    """Scroll what was filled into sight, where the page is too narrow to show it beside a form."""
    ui.run_javascript(f"getHtmlElement({element.id})?.scrollIntoView({{block: 'nearest'}})")
