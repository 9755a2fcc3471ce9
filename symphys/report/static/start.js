// Starts the motions of a page. Of a page in a batch what plays them lies beside all pages: it may be missing.

if (typeof Player === "undefined") document.querySelectorAll(".lost").forEach((note) => { note.hidden = false; });
else document.querySelectorAll(".animation").forEach((root) => new Player(root));
