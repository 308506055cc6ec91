"""The review page's server: `cadpose review` shows one store's annotations to a browser on this machine."""
