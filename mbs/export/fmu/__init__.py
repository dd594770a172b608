"""Functional mock-up units: a model for other simulators."""
