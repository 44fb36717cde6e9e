"""Ways to a device: the maker's library, hidapi, an emulated Omni, a captured session. All speak in whole
reports."""
