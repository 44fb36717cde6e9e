"""Ways to a device: the vendor's library, hidapi, an emulated Omni, a captured session. All speak in whole
reports."""
