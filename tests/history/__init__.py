"""Drop zones that change while runs read them: away and back, replaced, killed, a full disk."""
