"""The cross-IMU report: tables to views, views to figures, all to one page."""
