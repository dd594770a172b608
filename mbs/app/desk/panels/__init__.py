"""What the menus open: forms, equations, postures, tables, plots and downloads."""
