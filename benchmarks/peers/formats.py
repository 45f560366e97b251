"""Opens every curve file of a result folder with the tools that people open them with, and compares
each with curve.csv to the bit.

Usage: formats.py FOLDER [LABEL.nii.gz MASK.png], where FOLDER was written by

    accurate reconstruct PAIR --input mask -o FOLDER --also ply,vtp,mrk-json,npy,npz,parquet

The label and its mask come from the example `mask_to_nifti` of accurate-io.
Exits non-zero if one file differs or cannot be opened.
"""

import json
import sys
from pathlib import Path

import meshio
import nibabel
import numpy as np
import pandas
import pyarrow.parquet
import pyvista
import slicerio
import vtk
from plyfile import PlyData
from vtk.util.numpy_support import vtk_to_numpy


def reference(folder):
    table = pandas.read_csv(folder / "curve.csv")
    names = [title.split("[")[0] for title in table.columns]
    units = {t.split("[")[0]: t.split("[")[1].rstrip("]") for t in table.columns if "[" in t}
    table.columns = names
    return table, units


def with_vtk(folder, table, units):
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(folder / "curve.vtp"))
    reader.Update()
    data = reader.GetOutput()
    assert data.GetNumberOfLines() == 1
    line = data.GetCell(0).GetPointIds()
    assert [line.GetId(i) for i in range(line.GetNumberOfIds())] == list(range(len(table)))
    for name in table.columns[3:]:
        values = vtk_to_numpy(data.GetPointData().GetArray(name))
        assert np.array_equal(values, table[name]), name
    field = data.GetFieldData()
    assert field.GetAbstractArray("unit").GetValue(0) == units["arc_length"]
    for name, unit in units.items():
        assert field.GetAbstractArray(f"unit:{name}").GetValue(0) == unit, name
    return vtk_to_numpy(data.GetPoints().GetData())


def with_pyvista(folder, table, units):
    mesh = pyvista.read(folder / "curve.vtp")
    for name in table.columns[3:]:
        assert np.array_equal(mesh.point_data[name], table[name]), name
    return np.asarray(mesh.points)


def with_meshio(folder, table, units):
    # meshio reads no PolyData; it reads the PLY.
    return meshio.read(folder / "curve.ply").points


def with_plyfile(folder, table, units):
    vertex = PlyData.read(folder / "curve.ply")["vertex"]
    for name in table.columns[3:]:
        assert np.array_equal(vertex[name], table[name]), name
    return np.stack([vertex[axis] for axis in "xyz"], axis=1)


def with_slicerio(folder, table, units):
    path = folder / "curve.mrk.json"
    [markup] = json.loads(path.read_text())["markups"]
    assert markup["type"] == "Curve" and markup["coordinateSystem"] == "LPS"
    measured = {m["name"]: m for m in markup["measurements"]}
    for name in table.columns[3:]:
        assert np.array_equal(measured[name]["controlPointValues"], table[name]), name
        assert measured[name]["units"] == units.get(name, ""), name
    points = np.array([p["position"] for p in markup["controlPoints"]])
    # slicerio writes Markups, from a point list: ours must say the same in the same words.
    point_list = folder / "points.fcsv"
    header = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n# columns = "
    columns = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
    rows = "".join(
        f"{i + 1},{x!r},{y!r},{z!r},0,0,0,1,1,1,0,{i + 1},,\n" for i, (x, y, z) in enumerate(points.tolist())
    )
    point_list.write_text(header + columns + rows)
    slicerio.fcsv_to_markups_json(str(point_list), str(folder / "points.mrk.json"))
    theirs = json.loads((folder / "points.mrk.json").read_text())
    [other] = theirs["markups"]
    assert other["coordinateSystem"] == markup["coordinateSystem"]
    assert np.array_equal(points, [p["position"] for p in other["controlPoints"]])
    assert set(markup) - {"worldUnit", "measurements", "name"} <= set(other) | {"coordinateUnits"}, set(other)
    assert set(markup["controlPoints"][0]) <= set(other["controlPoints"][0]) | {"positionStatus"}
    assert markup["worldUnit"] in ("mm", "unit"), "scaled files do not compare to the bit"
    return points


def with_numpy(folder, table, units):
    archive = np.load(folder / "curve.npz")
    for name in table.columns[3:]:
        assert np.array_equal(archive[name], table[name]), name
    named = json.loads(bytes(archive["units_json"]))
    assert named["points"] == units["arc_length"]
    assert all(named[name] == unit for name, unit in units.items())
    points = np.load(folder / "curve.npy")
    assert np.array_equal(points, archive["points"])
    return points


def with_pyarrow(folder, table, units):
    read = pyarrow.parquet.read_table(folder / "curve.parquet")
    metadata = read.schema.metadata
    assert metadata[b"unit"].decode() == units["arc_length"]
    frame = read.to_pandas()
    assert list(frame.columns) == list(table.columns)
    for name in table.columns:
        assert np.array_equal(frame[name], table[name]), name
    return frame[["x", "y", "z"]].to_numpy()


def label(path, mask):
    from PIL import Image

    image = nibabel.load(path)
    values = np.asarray(image.dataobj)
    expected = (np.asarray(Image.open(mask).convert("L")) > 0).T[..., None]
    assert values.shape == expected.shape and np.array_equal(values > 0, expected)
    assert image.header.get_xyzt_units()[0] == "mm"


def main():
    folder = Path(sys.argv[1])
    table, units = reference(folder)
    points = table[["x", "y", "z"]].to_numpy()
    failed = 0
    readers = [with_vtk, with_pyvista, with_meshio, with_plyfile, with_slicerio, with_numpy, with_pyarrow]
    for reader in readers:
        name = reader.__name__.removeprefix("with_")
        try:
            assert np.array_equal(reader(folder, table, units), points), "points differ"
            print(f"ok   {name}: {len(points)} points, {len(table.columns) - 3} columns")
        except Exception as problem:  # each tool fails in its own way
            failed += 1
            print(f"FAIL {name}: {type(problem).__name__}: {problem}")
    if len(sys.argv) > 3:
        label(sys.argv[2], sys.argv[3])
        print("ok   nibabel: label map")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
