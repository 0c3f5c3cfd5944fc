// A machine by itself, at a pose.
const data = JSON.parse(document.getElementById("data").textContent), body = new MachineBody(data.scene);
const whole = () => body.outline(data.pose);
const view = new Viewer(document.getElementById("view"), {
  frame: false,
  room: [40, 40],
  iso: body.iso,
  box: () => endsOf(whole()),
  outline: whole,
  draw(g, viewer) {
    body.drawReach(g, viewer);
    paint(g, viewer, body.items(viewer, data.pose, { floor: body.floor }), false);
  },
});
watchTheme(() => view.redraw());
view.resize();
