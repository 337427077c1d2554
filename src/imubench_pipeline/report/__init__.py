"""The report: tables to views, views to pages and figures."""
