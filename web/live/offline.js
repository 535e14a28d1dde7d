// Service worker of the folder form: what was loaded once works without a network afterwards. Names change with contents.
const NAME = "visavis-{{version}}", FILES = "{{files}}";
self.addEventListener("install", (event) => event.waitUntil(caches.open(NAME).then((cache) => cache.addAll(FILES)).then(() => self.skipWaiting())));
self.addEventListener("activate", (event) => event.waitUntil((async () => {
  for (const name of await caches.keys()) if (name.startsWith("visavis-") && name !== NAME) await caches.delete(name);
  await self.clients.claim();
})()));
self.addEventListener("fetch", (event) => {
  if (event.request.method !== "GET" || new URL(event.request.url).origin !== location.origin) return;
  // The page itself from the network where there is one, so that a new one is seen.
  const fresh = event.request.mode === "navigate";
  event.respondWith((async () => {
    const cache = await caches.open(NAME), kept = await cache.match(event.request, { ignoreSearch: true });
    if (kept && !fresh) return kept;
    try { return await fetch(event.request); } catch (error) { if (kept) return kept; throw error; }
  })());
});
