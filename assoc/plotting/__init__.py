"""Pictures: functions that draw into matplotlib axes, and the HTML reports."""
