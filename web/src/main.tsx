import { render } from "preact";

import "./app/page.css";

const root = document.getElementById("app");
if (root) render(<p>cadpose review</p>, root);
