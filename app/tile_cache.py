"""Tiles in the cache: those of the last picture of a model, beside its hierarchy.

They are called after the hierarchy and the number of texels a side, so they are never out of date either. Nothing here
raises: without them tiles are baked.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from app.cache_folder import make_room, touch

if TYPE_CHECKING:
    from app.cache import Cache
    from app.scene import Scene
    from hierarchy.tile_shelf import ShownTiles


def find_tiles(cache: Cache | None, scene: Scene, texels: int) -> ShownTiles | None:
    """Map the tiles that were kept of a scene; None: there are none.

    texels : along one side at most (w_s)
    """
    entry = scene.provenance.entry
    if cache is None or not entry:
        return None
    from hierarchy.tensor_file import DamagedFile
    from hierarchy.tile_store import load_tiles

    path = _path(cache, entry, texels)
    try:
        kept = load_tiles(path, scene.hierarchy, texels, entry)
    except FileNotFoundError:
        return None
    except (DamagedFile, ValueError, OSError, MemoryError) as error:
        cache.complain(f"{path.name} is not used", error)
        return None
    _touch(cache, path, entry)
    cache.say(f"cache: found {len(kept.tiles.nodes)} tiles in {path}")
    return kept


def keep_tiles(cache: Cache, scene: Scene, shown: ShownTiles) -> None:
    """Write the tiles of a scene's picture to the cache, in place of those of an earlier one.

    Where the scene's hierarchy is not in the cache nothing is written, and to make room for tiles it never goes.
    """
    entry = scene.provenance.entry
    if not entry:
        return
    from hierarchy.tile_parts import bytes_of_each
    from hierarchy.tile_store import save_tiles

    try:
        model = cache.path_of(entry)
        if not model.is_file():
            # The cache has been cleared meanwhile.
            return
        size = int(bytes_of_each(shown.tiles).sum())
        if not make_room(cache.folder, size, cache.most_bytes, spared=model):
            cache.say(f"cache: tiles are not kept, {size / 1e6:.1f} MB are too many for it or for the disk")
            return
        path = _path(cache, entry, shown.texels)
        written = save_tiles(path, shown, scene.hierarchy, entry)
    except (OSError, ValueError, MemoryError) as error:
        cache.complain("tiles are not kept", error)
        return
    _touch(cache, path, entry)
    cache.say(f"cache: kept {len(shown.tiles.nodes)} tiles, {written / 1e6:.1f} MB, in {path}")


def _touch(cache: Cache, tiles: Path, entry: str) -> None:
    """Note that tiles have been used, and last their hierarchy: without it they are for nothing, so they go first."""
    touch(tiles)
    touch(cache.path_of(entry))


def _path(cache: Cache, entry: str, texels: int) -> Path:
    return cache.folder / f"{entry}.tiles{texels}.safetensors"
