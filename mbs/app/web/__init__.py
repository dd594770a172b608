"""The app: a page in the browser with a robot as a table, its picture and its equations."""
