"""The frame of every HTML page that cadpose writes: no script, nothing loaded from the network."""

from __future__ import annotations

import base64
from html import escape

from PIL import Image

from cadpose.annotations.style import jpeg_bytes, short

_STYLE = """
:root{color-scheme:light dark;--paper:#fff;--ink:#181c21;--faint:#626a73;--line:#dfe3e8;--tile:#eff1f4}
@media(prefers-color-scheme:dark){
:root{--paper:#15181c;--ink:#e8eaed;--faint:#9aa3ad;--line:#2d333a;--tile:#aab0b8}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1180px;padding:24px 20px 48px;background:var(--paper);color:var(--ink);
font:15px/1.45 system-ui,sans-serif;overflow-wrap:anywhere}
h1{font-size:20px;margin:0 0 2px}h2{font-size:17px;margin:34px 0 6px;padding-left:10px;
border-left:5px solid var(--c,var(--line))}
p{margin:0 0 10px}.faint,figcaption span:not(.flag),dt{color:var(--faint)}
img{display:block;max-width:100%;height:auto}
.overlay{width:100%;margin-top:14px;border-radius:6px}
.strip{display:grid;grid-template-columns:repeat(auto-fill,minmax(165px,1fr));gap:10px;margin:12px 0}
figure{margin:0;font-size:13px}figcaption{padding:4px 2px;line-height:1.35}
figcaption span:not(.flag){display:block}
.tile{display:flex;align-items:center;justify-content:center;aspect-ratio:1;background:var(--tile);
border-radius:5px;overflow:hidden}.tile img{max-height:100%}
.best .tile{outline:3px solid var(--c)}
dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 14px;margin:8px 0;font-size:14px}dd{margin:0}
.flag{margin-left:10px;padding:1px 8px;border-radius:9px;font-size:12px;font-weight:600;
background:#ffd34d;color:#181c21;vertical-align:2px;white-space:nowrap}
.gallery{display:grid;grid-template-columns:repeat(auto-fill,minmax(250px,1fr));gap:18px;margin-top:18px}
.gallery a{color:inherit;text-decoration:none}.gallery .tile{aspect-ratio:4/3;background:var(--line)}
.gallery .tile img{width:100%;height:100%;object-fit:contain}
table{border-collapse:collapse;margin:14px 0;font-size:14px;font-variant-numeric:tabular-nums}
td,th{padding:3px 12px;border-bottom:1px solid var(--line);text-align:right}
td:first-child,th:first-child{text-align:left;padding-left:0}th{color:var(--faint);font-weight:500}
.charts{display:grid;grid-template-columns:repeat(auto-fit,minmax(430px,1fr));gap:18px;margin:16px 0}
.charts img,.sheet{width:100%;border-radius:5px}
"""
_POLICY = "default-src 'none'; img-src {}; style-src 'unsafe-inline'"


def page(title: str, body: str, *, pictures_beside: bool = False) -> str:
    """A whole page around trusted HTML; the title is escaped.

    Its pictures are inlined; with ``pictures_beside`` they may also lie in files beside the page.
    """
    policy = _POLICY.format("data: 'self' file:" if pictures_beside else "data:")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width,initial-scale=1">\n'
        f"<title>{text(title)}</title><style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n"
    )


def text(value: str) -> str:
    """Any text as HTML, printable characters only, at most 400."""
    return escape(short(value, 400), quote=True)


def jpeg_uri(image: Image.Image) -> str:
    """An opaque picture as a ``data:`` address."""
    return data_uri("jpeg", jpeg_bytes(image))


def data_uri(kind: str, data: bytes) -> str:
    """The bytes of a ``"png"`` or ``"jpeg"`` as a ``data:`` address."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
