"""Bags: read, write, record, recover, import."""
