"""Ways to a device: hidapi, an emulated Omni, a captured session. All speak in whole reports."""
