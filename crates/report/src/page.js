'use strict';
// The replay: every gait at the same clock, drawn from recorded points.
(() => {
  const gaits = JSON.parse(document.getElementById('replay-data').textContent);
  const stage = document.getElementById('replay-stage');
  const play = document.getElementById('replay-play');
  const scrub = document.getElementById('replay-scrub');
  const clock = document.getElementById('replay-clock');
  const speeds = document.querySelectorAll('input[name="replay-speed"]');
  const grounds = document.querySelectorAll('input[name="replay-ground"]');
  const svg = (name, classes, parent) => {
    const element = document.createElementNS('http://www.w3.org/2000/svg', name);
    element.setAttribute('class', classes);
    parent.append(element);
    return element;
  };
  const path = (points) => 'M' + points.map((point) => point[0].toFixed(1) + ' ' + point[1].toFixed(1)).join('L');

  let reach = 0, top = 0, end = 0;
  for (const gait of gaits) {
    const legs = gait.near.length, width = 5 + 8 * legs, steps = gait.frames.length / width;
    const rows = [];
    for (let i = 0; i < steps; i++) {
      const row = gait.frames.slice(i * width, (i + 1) * width);
      for (let k = 0; i > 0 && k < width - 1; k++) row[k] += rows[i - 1][k];
      rows.push(row);
      top = Math.max(top, row[2] + gait.box[1] + gait.box[0] * Math.abs(row[3]) / 1000);
      for (let k = 4; k < width - 1; k += 2) reach = Math.max(reach, Math.abs(row[k]));
    }
    gait.rows = rows;
    delete gait.frames;
    reach = Math.max(reach, gait.box[0]);
    end = Math.max(end, steps * gait.dt);
  }
  const half = reach * 1.25, height = Math.min(top, reach * 2) * 1.12;

  for (const gait of gaits) {
    const card = document.createElement('div');
    card.className = 'gait';
    const head = document.createElement('div');
    head.className = 'head';
    const name = document.createElement('strong');
    name.className = 't' + gait.tone;
    name.textContent = gait.label;
    gait.state = document.createElement('span');
    head.append(name, gait.state);
    const view = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
    // An uphill looks like one: the whole picture turns about the place where the robot stands.
    const rise = half * Math.sin(Math.abs(gait.slope) * Math.PI / 180);
    view.setAttribute('viewBox', [-half, -height - rise, 2 * half, height + 46 + 2 * rise].join(' '));
    view.setAttribute('role', 'img');
    view.setAttribute('aria-label', 'side view of ' + gait.label);
    const scene = svg('g', '', view);
    scene.setAttribute('transform', 'rotate(' + -gait.slope + ')');
    gait.ground = svg('path', 'ground', scene);
    gait.marks = svg('g', 'marks', scene);
    const stroke = ' s' + gait.tone, fill = 'f' + gait.tone;
    const limb = (leg) => svg('path', (gait.near[leg] ? 'limb' : 'far') + stroke, scene);
    const foot = (leg) => svg('circle', fill + (gait.near[leg] ? '' : ' dim'), scene);
    const legs = gait.near.map((near, leg) => leg);
    gait.parts = [];
    for (const leg of legs.filter((leg) => !gait.near[leg])) gait.parts[leg] = { limb: limb(leg), foot: foot(leg) };
    gait.body = svg('path', 'box' + stroke + ' ' + fill, scene);
    for (const leg of legs.filter((leg) => gait.near[leg])) gait.parts[leg] = { limb: limb(leg), foot: foot(leg) };
    card.append(head, view);
    gait.card = card;
    stage.append(card);
  }

  const draw = (time) => {
    for (const gait of gaits) {
      const last = gait.rows.length - 1;
      const exact = Math.min(time / gait.dt, last), step = Math.floor(exact), share = exact - step;
      const from = gait.rows[step], to = gait.rows[Math.min(step + 1, last)];
      const at = (k) => from[k] + share * (to[k] - from[k]);
      const x = at(0), way = at(1), up = at(2), pitch = at(3) / 1000, contacts = from[from.length - 1];
      const corner = (a, b) => {
        const along = a * gait.box[0], above = b * gait.box[1];
        return [Math.cos(pitch) * along + Math.sin(pitch) * above,
          -(up - Math.sin(pitch) * along + Math.cos(pitch) * above)];
      };
      gait.body.setAttribute('d', path([corner(1, 1), corner(1, -1), corner(-1, -1), corner(-1, 1)]) + 'Z');
      gait.parts.forEach((part, leg) => {
        const point = (i) => [at(4 + 8 * leg + 2 * i), -up - at(5 + 8 * leg + 2 * i)];
        part.limb.setAttribute('d', path([point(0), point(1), point(3), point(2), point(0)]));
        const end = point(3);
        part.foot.setAttribute('cx', end[0].toFixed(1));
        part.foot.setAttribute('cy', end[1].toFixed(1));
        part.foot.setAttribute('r', contacts >> leg & 1 ? 9 : 3);
      });
      // A tick every 0.1 m, a number every 0.5 m.
      let ticks = 'M' + -half + ' 0H' + half;
      const numbers = [];
      for (let m = Math.ceil((way - half) / 100); m * 100 < way + half; m++) {
        ticks += 'M' + (m * 100 - way).toFixed(1) + ' 0v' + (m % 5 ? 6 : 12);
        if (m % 5 === 0) numbers.push([m * 100 - way, m / 10]);
      }
      gait.ground.setAttribute('d', ticks);
      while (gait.marks.childNodes.length < numbers.length) svg('text', 'mut', gait.marks).setAttribute('y', 37);
      gait.marks.childNodes.forEach((mark, i) => {
        mark.textContent = i < numbers.length ? numbers[i][1].toFixed(1) + ' m' : '';
        mark.setAttribute('x', i < numbers.length ? numbers[i][0].toFixed(1) : 0);
      });
      const fell = time / gait.dt >= last && gait.terminated;
      gait.state.textContent = (x / 1000).toFixed(2) + ' m' + (fell ? ', fell: ' + fell.replace(/_/g, ' ') : '');
    }
    clock.textContent = time.toFixed(2) + ' s';
  };

  const choose = () => {
    const chosen = document.querySelector('input[name="replay-ground"]:checked');
    for (const gait of gaits) gait.card.hidden = chosen !== null && Number(chosen.value) !== gait.slope;
  };
  grounds.forEach((ground) => ground.addEventListener('change', choose));
  choose();

  let time = 0, playing = false, before = null, request = null;
  const show = () => { scrub.value = time; draw(time); };
  const frame = (now) => {
    if (before !== null) {
      const speed = Number(document.querySelector('input[name="replay-speed"]:checked').value);
      time = Math.min(time + speed * (now - before) / 1000, end);
    }
    before = now;
    show();
    if (time >= end) return pause();
    request = requestAnimationFrame(frame);
  };
  const pause = () => {
    playing = false;
    before = null;
    cancelAnimationFrame(request);
    play.textContent = 'Play';
    play.setAttribute('aria-pressed', 'false');
  };
  const start = () => {
    if (time >= end) time = 0;
    playing = true;
    play.textContent = 'Pause';
    play.setAttribute('aria-pressed', 'true');
    request = requestAnimationFrame(frame);
  };
  scrub.max = end;
  play.addEventListener('click', () => playing ? pause() : start());
  scrub.addEventListener('input', () => { time = Number(scrub.value); before = null; draw(time); });
  speeds.forEach((speed) => speed.addEventListener('change', () => { before = null; }));
  document.getElementById('replay').addEventListener('keydown', (event) => {
    if (event.key === 'k') { event.preventDefault(); play.click(); }
  });
  document.getElementById('replay').classList.add('ready');
  time = Math.min(1.5, end);
  show();
})();
