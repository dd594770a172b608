"""Panels that the menus open: forms, equations, configurations, tables, plots and downloads."""
