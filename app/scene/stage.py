"""What stands round the hand: light, ground and camera."""

from viser import CameraHandle, ClientHandle, ViserServer

from handscope.app.scene import palette, view


def set_up(server: ViserServer, narrow: float) -> None:
    """Set the camera that keeps `narrow` (view.NARROW) in view, a soft light from behind the viewer's left shoulder, and a faint grid below the hand."""
    camera, scene = server.initial_camera, server.scene
    camera.position, camera.look_at, camera.up = view.CAMERA, view.LOOK_AT, (0.0, 0.0, 1.0)
    camera.fov, camera.near, camera.far = view.FIELD_OF_VIEW, view.NEAR, view.FAR
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map("studio", environment_intensity=0.22)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 252, 248), ground_color=(176, 170, 168), intensity=0.70
    )
    scene.add_light_directional(
        "/light/key",
        color=(255, 248, 240),
        intensity=1.7,
        cast_shadow=True,
        position=(-0.35, -0.70, 1.0),
    )
    scene.add_light_directional(
        "/light/rim", color=(226, 236, 255), intensity=0.55, position=(0.9, 0.7, 0.5)
    )
    scene.add_grid(
        "/ground",
        width=12.0,
        height=12.0,
        cell_size=0.2,
        cell_color=palette.GROUND,
        section_size=1.0,
        section_color=palette.GROUND_SECTION,
        fade_distance=7.5,
        fade_from="origin",
        shadow_opacity=0.11,
        position=(0.0, 0.0, view.GROUND),
    )

    async def refit(camera: CameraHandle) -> None:
        _fit(camera, narrow)

    async def follow(client: ClientHandle) -> None:
        _fit(client.camera, narrow)
        client.camera.on_update(refit)

    server.on_client_connect(follow)


def _fit(camera: CameraHandle, narrow: float) -> None:
    """Widen the view of a narrow window, so that no finger is cut off."""
    wanted = view.field_of_view(camera.aspect, narrow)
    if abs(camera.fov - wanted) > 0.002:
        camera.fov = wanted
