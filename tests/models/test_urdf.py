"""URDFs as they come: meshes of many formats, missing files, odd names."""

import mujoco
import numpy as np
import pytest
import trimesh

from tauguard.models import SceneSpec, compose
from tauguard.models.arm_file import HIDDEN, read_arm
from tauguard.models.urdf import coarse, load_mesh

#: A box of 0.2 x 0.1 x 0.4 m in hundredths of a metre, as Collada writes it.
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="24">{points}</float_array><technique_common>
<accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
URDF = """<robot name="arm" {more}><link name="base"/>{extra}
  <link name="a"><inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0"
    iyz="0"/></inertial>{shapes}</link>
  <joint name="j" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 .2"/><limit lower="-2" upper="2" effort="50" velocity="2"/></joint></robot>"""


def shape(role, file, scale="1 1 1"):
    mesh = f'<mesh filename="package://arm/{file}" scale="{scale}"/>'
    return f"<{role}><geometry>{mesh}</geometry></{role}>"


@pytest.fixture
def box():
    return trimesh.creation.box((0.2, 0.1, 0.4))


def write(folder, box, kind):
    path = folder / f"box.{kind}"
    if kind == "dae":
        points = " ".join(f"{100 * x:g}" for x in box.vertices.ravel())
        path.write_text(DAE.format(points=points, faces=" ".join(map(str, box.faces.ravel()))))
    elif kind == "msh":  # MuJoCo's own: four counts, then vertices, normals, texture and faces
        counts = np.array([8, 0, 0, 12], dtype="<i4")
        body = box.vertices.astype("<f4").tobytes() + box.faces.astype("<i4").tobytes()
        path.write_bytes(counts.tobytes() + body)
    else:
        box.export(path, file_type="stl_ascii" if kind == "STL" else kind)
    return path.name


def arm(folder, shapes, more="", extra=""):
    (folder / "arm.urdf").write_text(URDF.format(shapes=shapes, more=more, extra=extra))
    return read_arm(folder / "arm.urdf")


@pytest.mark.parametrize("kind", ["dae", "obj", "stl", "STL", "ply", "glb", "off", "msh"])
def test_meshes_of_every_format_show_and_collide(tmp_path, box, kind):
    name = write(tmp_path, box, kind)
    file = arm(tmp_path, shape("visual", name) + shape("collision", name))
    assert not file.replaced
    shown, solid = file.spec.body("a").geoms
    assert (shown.contype, shown.conaffinity, solid.group) == (0, 0, HIDDEN)
    assert solid.contype
    assert shown.group < HIDDEN
    model = file.spec.compile()
    sides = np.array([0.1, 0.05, 0.2])
    for geom in range(2):
        np.testing.assert_allclose(np.sort(model.geom_aabb[geom, 3:]), np.sort(sides), atol=1e-6)


def test_what_only_shows_collides_as_its_hull_and_is_named(tmp_path, box):
    file = arm(tmp_path, shape("visual", write(tmp_path, box, "ply")))
    assert file.replaced == {"a": "convex hull of its visual shapes"}
    (geom,) = file.spec.body("a").geoms
    assert geom.contype
    assert geom.group < HIDDEN


def test_files_that_are_not_there_or_no_meshes_are_named_and_shown(tmp_path):
    (tmp_path / "bad.dae").write_text("no mesh")
    for name, why in (("gone.stl", "is not there"), ("bad.dae", "cannot be read")):
        file = arm(tmp_path, shape("collision", name))
        assert file.replaced["a"].startswith("capsule of 50 mm")
        assert f"{name} {why}" in file.replaced["a"]
        assert file.sticks == ("a",)
        (stick,) = file.spec.body("a").geoms
        assert stick.group < HIDDEN
    scene = compose(SceneSpec(arm=str(tmp_path / "arm.urdf")))
    assert "bad.dae" in scene.facts.sources["shapes"]


def test_a_mirrored_mesh_and_a_sheet_have_a_volume(tmp_path, box):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    name = write(tmp_path, sheet, "stl")
    model = arm(tmp_path, shape("collision", name)).spec.compile()
    assert model.ngeom == 1
    name = write(tmp_path, box, "stl")
    model = arm(tmp_path, shape("collision", name, "1 -1 1")).spec.compile()
    corner = model.mesh_vert[model.mesh_face[0]].astype(float)
    outward = np.cross(corner[1] - corner[0], corner[2] - corner[0]) @ corner.mean(axis=0)
    assert outward > 0


def test_prefixes_that_nothing_declares_do_no_harm(tmp_path, box):
    extra = '<xacro:unknown a:b="1"/><link name="drake:thing"/>'
    extra += '<joint name="f" type="fixed"><parent link="base"/><child link="drake:thing"/></joint>'
    file = arm(tmp_path, shape("visual", write(tmp_path, box, "obj")), extra=extra)
    assert file.joints == ("j",)


def test_a_coarse_mesh_keeps_its_extents():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    vertices, faces = coarse(np.array(ball.vertices), np.array(ball.faces))
    assert len(faces) < 0.35 * len(ball.faces)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 0.1, rtol=1e-6)
    np.testing.assert_allclose(np.ptp(vertices, axis=0), 0.2, atol=0.2 / 24)
    assert faces.max() < len(vertices)


def test_a_mesh_file_without_triangles_says_so(tmp_path):
    (tmp_path / "empty.obj").write_text("v 0 0 0\n")
    with pytest.raises(ValueError, match=r"cannot be read|no triangles"):
        load_mesh(tmp_path / "empty.obj")


def test_two_files_of_one_name_in_two_folders_stay_two(tmp_path, box):
    for folder, size in (("visual", 0.4), ("collision", 0.2)):
        (tmp_path / folder).mkdir()
        trimesh.creation.box((size,) * 3).export(tmp_path / folder / "part.stl")
    file = arm(
        tmp_path, shape("visual", "visual/part.stl") + shape("collision", "collision/part.stl")
    )
    model = file.spec.compile()
    assert model.geom_aabb[0, 3] == pytest.approx(0.2)
    assert model.geom_aabb[1, 3] == pytest.approx(0.1)
    assert model.geom_type[1] == mujoco.mjtGeom.mjGEOM_MESH


def test_detailed_meshes_of_an_mjcf_file_show_although_they_have_texture_coordinates(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    lines = [f"v {x} {y} {z}" for x, y, z in ball.vertices] + ["vt 0 0"]
    lines += [f"vn {x} {y} {z}" for x, y, z in ball.vertices / 0.1]
    lines += ["f " + " ".join(f"{i + 1}/1/{i + 1}" for i in face) for face in ball.faces]
    (tmp_path / "ball.obj").write_text("\n".join(lines))
    (tmp_path / "arm.xml").write_text(
        '<mujoco><asset><mesh file="ball.obj"/></asset><worldbody><body name="a">'
        '<joint name="j" axis="0 1 0"/><geom type="mesh" mesh="ball" contype="0" conaffinity="0"/>'
        '<geom type="box" size=".05 .05 .05"/></body></worldbody></mujoco>'
    )
    model = read_arm(tmp_path / "arm.xml").spec.compile()
    assert model.nmesh == 1
    assert 1000 < model.mesh_facenum[0] < 0.35 * len(ball.faces)
    kinds = [mujoco.mjtGeom(int(kind)).name for kind in model.geom_type]
    assert sorted(kinds) == ["mjGEOM_BOX", "mjGEOM_MESH"]
    shown = kinds.index("mjGEOM_MESH")
    assert model.geom_aabb[shown, 3:] == pytest.approx([0.1] * 3, abs=0.01)
