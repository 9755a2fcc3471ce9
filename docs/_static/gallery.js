/* The gallery: a button for each tag shows the problems that have it. Tables with a last column "tags" take part. */
document.addEventListener("DOMContentLoaded", () => {
    const place = document.querySelector(".gallery-buttons");
    if (!place) return;
    const rows = [...document.querySelectorAll("article table")]
        .filter((table) => table.tHead && table.tHead.rows[0].lastElementChild.textContent.trim() === "tags")
        .flatMap((table) => [...table.tBodies[0].rows]);
    const tags = (row) => row.lastElementChild.textContent.split(",").map((tag) => tag.trim());
    const names = [...new Set(rows.flatMap(tags))].filter(Boolean).sort();

    const bar = document.createElement("div");
    bar.className = "gallery-filter";
    const show = (chosen) => {
        for (const button of bar.children) button.setAttribute("aria-pressed", String(button.dataset.tag === chosen));
        for (const row of rows) row.hidden = chosen !== "" && !tags(row).includes(chosen);
        for (const section of document.querySelectorAll("article section section")) {
            const own = rows.filter((row) => section.contains(row));
            section.hidden = own.length > 0 && own.every((row) => row.hidden);
        }
    };
    for (const tag of ["", ...names]) {
        const button = document.createElement("button");
        button.type = "button";
        button.dataset.tag = tag;
        button.textContent = tag || "all";
        button.addEventListener("click", () => show(tag));
        bar.append(button);
    }
    place.replaceWith(bar);
    show("");
});
