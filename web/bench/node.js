// One measurement in a process of its own: node web/bench/node.js '{"module": …}' prints JSON.
import { load } from "../tests/load.js";
import { measure } from "./measure.js";

const request = JSON.parse(process.argv[2]);
const Here = { load: ({ bundle, module }) => load({ bundle, module }) };
console.log(JSON.stringify(await measure(Here, request)));
