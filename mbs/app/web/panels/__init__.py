"""What the menus open: forms, equations, configurations, tables, plots and downloads."""
