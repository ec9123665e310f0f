// Heads of tables of the class "sortable" sort the rows: by number where cells have one, what is not told at the end.
(() => {
  'use strict';
  const keyOf = (row, column) => {
    const cell = row.cells[column];
    const key = cell.dataset.key === undefined ? cell.textContent : cell.dataset.key;
    return key !== '' && Number.isFinite(Number(key)) ? Number(key) : key;
  };
  const compare = (a, b, sign) => {
    if (a === '' || b === '') return (a === '') - (b === '');
    if (typeof a === 'number' && typeof b === 'number') return sign * (a - b);
    return sign * String(a).localeCompare(String(b));
  };
  for (const table of document.querySelectorAll('table.sortable')) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => head.firstElementChild.addEventListener('click', () => {
      const sign = head.getAttribute('aria-sort') === 'ascending' ? -1 : 1;
      heads.forEach((other) => other.removeAttribute('aria-sort'));
      head.setAttribute('aria-sort', sign > 0 ? 'ascending' : 'descending');
      const rows = [...table.tBodies[0].rows].map((row) => [keyOf(row, column), row]);
      rows.sort(([a], [b]) => compare(a, b, sign));
      table.tBodies[0].append(...rows.map(([, row]) => row));
    }));
  }
  const filter = document.querySelector('input.filter');
  filter.addEventListener('input', () => {
    const wanted = filter.value.toLowerCase();
    for (const row of document.querySelector('table.filtered').tBodies[0].rows) row.hidden = !row.textContent.toLowerCase().includes(wanted);
  });
})();
