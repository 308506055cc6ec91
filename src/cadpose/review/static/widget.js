// src/widget.ts
var e = { render() {} };
export { e as default };
