"""The messages: records, layouts, and the one coder of their bytes (CDR). No other room knows where a number stands."""
