"""Every action on the review's page, by mouse or keyboard, in a real Chromium with a real server."""
