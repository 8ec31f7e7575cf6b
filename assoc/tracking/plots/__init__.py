"""Radar plots in windows of time, instead of scans."""
