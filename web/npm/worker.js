// What runs in the Worker.

import { serve } from "./host.js";

const port = { postMessage: (message, transfer) => globalThis.postMessage(message, transfer) };
serve(port);
globalThis.onmessage = (event) => port.onmessage(event);
