"""What stands round the hand: light and the first camera."""

from viser import ViserServer

from handscope.app.scene import view

KEY_LIGHT = "/light/key"  # viser_page.py lets it cast the shadow
REACH = 3.2  # scene units from the middle that a hand's skin reaches at most, two hands beside each other included


def set_up(server: ViserServer) -> None:
    """Set the first camera, and a soft light from behind the viewer's left shoulder, a weak one from below: the palm is looked at, too."""
    camera, scene = server.initial_camera, server.scene
    camera.position, camera.look_at, camera.up = view.CAMERA, view.LOOK_AT, (0.0, 0.0, 1.0)
    camera.fov, camera.near, camera.far = view.FIELD_OF_VIEW, view.NEAR, view.FAR
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map("studio", environment_intensity=0.22)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 252, 248), ground_color=(176, 170, 168), intensity=0.70
    )
    scene.add_light_directional(
        KEY_LIGHT,
        color=(255, 248, 240),
        intensity=1.7,
        position=(-0.35, -0.70, 1.0),
    )
    scene.add_light_directional(
        "/light/rim", color=(226, 236, 255), intensity=0.55, position=(0.9, 0.7, 0.5)
    )
    scene.add_light_directional(
        "/light/fill", color=(255, 244, 236), intensity=0.9, position=(0.0, 0.1, -1.0)
    )
